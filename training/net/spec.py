# SPDX-License-Identifier: Apache-2.0
"""What the net is made of: numbers that the model, the integer reference and the program share.

Activations are whole numbers from 0 to 127 in steps of 2^-5, weights from -127 to 127 in steps of 2^-6, so that sums
are whole numbers in steps of 2^-11 and rescaling is a shift.
"""
NEIGHBORS = 16  # of each scale
STRIDES = (1, 4, 16, 64)  # a scale holds every so-manieth point
CHANNELS = 48
PLAN = (0, 1, 2, 3, 2, 1, 0)  # the scale of each layer
GATED = 3  # layers from this one on add to the step
GATES = 3  # vectors of an edge that a gated layer weighs
POINT_FEATURES = 28
EDGE_FEATURES = 12
OUTPUTS = 2  # coefficients of the normal, and of the way back to the measured place
TRUST = 1.0  # noises; a longer way d from the default run becomes TRUST^2 / d

SLIDES = 4  # rounds in which points slide apart along the surface, before the net
SLIDE = 0.4  # of the weighted sum of offsets
FARTHEST_SLIDE = 1.0  # noises

ACTIVATION = 32.0  # steps of an activation in 1
WEIGHT = 64.0
SUM = ACTIVATION * WEIGHT
STORED = 256.0  # steps of what a layer keeps of each neighbour, in 16 bits

# Features as whole numbers: floor(factor * value + offset + 0.5), within 0..127.
HEIGHT = (16.0, 64.0)  # in noises, -4 to 4
SIZE = (32.0, 0.0)  # 0 to 4
SHARE = (127.0, 0.0)  # 0 to 1
STEEPNESS = (160.0, 0.0)
SLOPE = (64.0, 64.0)  # -1 to 1
SIDE = (32.0, 64.0)  # -2 to 2
CLIP = 4.0  # noises, of heights that gates weigh

# Families of which nets before left some clouds worse than the default run: pieces.py draws more of them, train.py gives
# them turns of their own.
HARD = ("object_anisotropic", "much_noise_along", "thin_plates", "fine_relief", "terrestrial_close", "grid_waves",
        "airborne_lines", "sonar_fans", "object_carved", "object_faceted")
