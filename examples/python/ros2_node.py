# SPDX-License-Identifier: Apache-2.0
"""A ROS 2 node: denoises the messages on /points and publishes them on /points_denoised.

    ros2 run ... or: python ros2_node.py --ros-args -r points:=/camera/depth/points"""
from __future__ import annotations

from typing import Any

import point_cloud2
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2

import pointfair as pf


class Denoiser(Node):  # type: ignore[misc,unused-ignore]
    """Parameters are automatic, so that they follow the noise of each message from place to place."""

    def __init__(self) -> None:
        super().__init__("pointfair")
        self.pipeline = pf.Pipeline()
        self.publisher = self.create_publisher(PointCloud2, "points_denoised", qos_profile_sensor_data)
        self.create_subscription(PointCloud2, "points", self.denoise, qos_profile_sensor_data)

    def denoise(self, message: Any) -> None:
        """Publishes the message with moved points."""
        self.pipeline.load(point_cloud2.positions(message))
        message.data = point_cloud2.with_positions(message, self.pipeline.run())
        self.publisher.publish(message)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Denoiser())
