// A node that says where the laser is.

#include <cmath>
#include <memory>

#include "geometry_msgs/msg/transform_stamped.hpp"
#include "rclcpp/rclcpp.hpp"
#include "tf2/LinearMath/Quaternion.hpp"
#include "tf2_geometry_msgs/tf2_geometry_msgs.hpp"
#include "tf2_ros/static_transform_broadcaster.h"

constexpr double kYaw = M_PI;

/// Publishes the static transform from base_link to laser.
class LaserFrame : public rclcpp::Node
{
public:
  LaserFrame()
  : Node("laser_frame"), broadcaster_(this)
  {
    tf2::Quaternion rotation;
    rotation.setRPY(0.0, 0.0, kYaw);
    geometry_msgs::msg::TransformStamped mount;
    mount.header.stamp = now();
    mount.header.frame_id = "base_link";
    mount.child_frame_id = "laser";
    mount.transform.translation.x = -0.032;
    mount.transform.translation.z = 0.172;
    mount.transform.rotation = tf2::toMsg(rotation);
    broadcaster_.sendTransform(mount);
  }

private:
  tf2_ros::StaticTransformBroadcaster broadcaster_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<LaserFrame>());
  rclcpp::shutdown();
  return 0;
}
