#include "quaternion_demo/rotations.hpp"

#include <cmath>

using geometry_msgs::msg::Quaternion;
using geometry_msgs::msg::Vector3;

// A sine of the pitch from which on it is 90 degrees: there, roll and yaw are one and the same.
constexpr double GIMBAL_LOCK = 0.9999999;

Quaternion from_axis_angle(double x, double y, double z, double angle)
{
  Quaternion q;  // no rotation: w is 1
  const double length = std::sqrt(x * x + y * y + z * z);
  if (length == 0.0) {
    return q;
  }
  const double sine = std::sin(angle / 2.0);
  q.x = x / length * sine;
  q.y = y / length * sine;
  q.z = z / length * sine;
  q.w = std::cos(angle / 2.0);
  return q;
}

Quaternion from_rpy(double roll, double pitch, double yaw)
{
  const double cr = std::cos(roll / 2.0), sr = std::sin(roll / 2.0);
  const double cp = std::cos(pitch / 2.0), sp = std::sin(pitch / 2.0);
  const double cy = std::cos(yaw / 2.0), sy = std::sin(yaw / 2.0);
  Quaternion q;
  q.x = sr * cp * cy - cr * sp * sy;
  q.y = cr * sp * cy + sr * cp * sy;
  q.z = cr * cp * sy - sr * sp * cy;
  q.w = cr * cp * cy + sr * sp * sy;
  return q;
}

Vector3 to_rpy(const Quaternion & q)
{
  Vector3 rpy;
  const double length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  if (length == 0.0) {
    return rpy;
  }
  const double x = q.x / length, y = q.y / length, z = q.z / length, w = q.w / length;
  const double sine = 2.0 * (w * y - z * x);
  if (std::abs(sine) > GIMBAL_LOCK) {
    rpy.y = std::copysign(M_PI / 2.0, sine);
    rpy.z = 2.0 * std::atan2(z, w);
    return rpy;
  }
  rpy.x = std::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
  rpy.y = std::asin(sine);
  rpy.z = std::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
  return rpy;
}
