#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""test_shared.py LIBRARY FINGERPRINT FINGERPRINT_SHARED: a program over the shared library prints what one over the static
library prints, and the library exports no name that the public headers do not mark."""
import re
import subprocess
import sys

library, inside, shared = sys.argv[1:]


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


PUBLIC_NAMES = """
Error NoPoints copy_without_points Pipeline size_of attribute attribute_info attribute_values attributes meant_attribute value_at polygons triangles read write check_write write_bytes remove_unfinished_files format_of format_to_write losses losses_table check_new_normals file_info in_file_units contents is_stored_scaled keeps_order las_name
takes_attributes normal_attributes set_normals orient_normals parse_selections selected_points selections_text without_points without_ignored set_limit limit_text movable_points apply_limits paper_preset
find_param choose_origin choose_origins choose_origin_by_sample TiledRun make_cloud needs_zones positions position_type set_positions check_not_geographic move_positions flag_of set_param param_text check_params list_devices parse_device version
act_on_outliers keeps_outliers outlier_attribute check_viewpoint file_viewpoints parse_viewpoints denoise_depth image_viewpoint length_text nearest_neighbors notes_on_cloud notes_on_faces notes_on_grid notes_on_kept_normals notes_on_materials notes_on_run notes_on_units notes_on_viewpoints notes_on_waveforms stored_float_step texture texture_map
""".split()
PUBLIC = re.compile(rf"^(typeinfo (name )?for |vtable for )?pointfair::({'|'.join(PUBLIC_NAMES)})\b")

symbols = [line.split(maxsplit=2) for line in run("nm", "-D", "-C", "--defined-only", library).splitlines()]
ours = {re.sub(r"\[abi:\w+\]", "", symbol[2]) for symbol in symbols if "pointfair::" in symbol[2] and not symbol[2].startswith("std::")}
hidden = sorted(name for name in ours if not PUBLIC.match(name) or re.search(r"Pipeline::State|PipelineAccess", name))
if hidden:
    raise SystemExit("exported, but not public:\n" + "\n".join(hidden))
if not any("Pipeline::run" in name for name in ours):
    raise SystemExit("the library does not export Pipeline::run")
if run(inside) != run(shared):
    raise SystemExit("the shared library gives other results")
