// Rotations, written in one way or another. All angles are in radians.

#pragma once

#include "geometry_msgs/msg/quaternion.hpp"
#include "geometry_msgs/msg/vector3.hpp"

// Turn by an angle about an axis of any length; about a zero axis not at all.
geometry_msgs::msg::Quaternion from_axis_angle(double x, double y, double z, double angle);

// Turn about the fixed axes x, y and z, in this order: q = q_yaw * q_pitch * q_roll.
geometry_msgs::msg::Quaternion from_rpy(double roll, double pitch, double yaw);

// Roll, pitch and yaw of a quaternion of any length; of a zero one no rotation.
geometry_msgs::msg::Vector3 to_rpy(const geometry_msgs::msg::Quaternion & q);
