# SPDX-License-Identifier: Apache-2.0
"""The bytes of a ROS PointCloud2 message, without ROS: positions in, moved positions back into a copy of the bytes."""
from __future__ import annotations

from array import array
from typing import Any, Protocol, Sequence

import numpy as np
from numpy.typing import NDArray

FLOAT32, FLOAT64 = 7, 8  # sensor_msgs/PointField


class Field(Protocol):
    """sensor_msgs/PointField."""

    name: str
    offset: int
    datatype: int
    count: int


class Message(Protocol):
    """The part of sensor_msgs/PointCloud2 that says where positions are."""

    height: int
    width: int
    fields: Sequence[Field]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: Any


def _coordinates(message: Message, data: Any) -> list[NDArray[Any]]:
    """x, y and z as views of the bytes, (height, width) each. Raises ValueError for a message that lacks one."""
    fields = {field.name: field for field in message.fields}
    order = ">" if message.is_bigendian else "<"
    views = []
    for axis in "xyz":
        if axis not in fields or fields[axis].datatype not in (FLOAT32, FLOAT64):
            raise ValueError(f"the message has no field {axis} of type FLOAT32 or FLOAT64")
        kind = f"{order}f{4 if fields[axis].datatype == FLOAT32 else 8}"
        if message.height * message.width == 0:  # an offset into no bytes is refused
            views.append(np.empty((message.height, message.width), kind))
            continue
        views.append(np.ndarray((message.height, message.width), kind, data, fields[axis].offset,
                                (message.row_step, message.point_step)))
    return views


def positions(message: Message) -> NDArray[Any]:
    """The positions in the type of the fields: (N, 3), or of an organised cloud (height, width, 3), whose pixels are NaN or
    (0, 0, 0) where the sensor saw nothing."""
    points = np.stack(_coordinates(message, message.data), axis=-1)
    return points if message.height > 1 else points.reshape(-1, 3)


def with_positions(message: Message, moved: NDArray[Any]) -> array[int]:
    """A copy of the message's bytes with these positions; all else stays. rclpy takes an array as it is, and looks at each
    byte of anything else."""
    data = array("B", message.data)
    for axis, view in enumerate(_coordinates(message, data)):
        view[...] = moved[..., axis].reshape(view.shape)
    return data
