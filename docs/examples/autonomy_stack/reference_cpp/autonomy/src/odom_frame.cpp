// A node that says where the robot is.

#include <memory>

#include "geometry_msgs/msg/transform_stamped.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "rclcpp/rclcpp.hpp"
#include "tf2_ros/transform_broadcaster.h"

using nav_msgs::msg::Odometry;

/// Broadcasts the pose of the odometry as the transform from odom to base_link.
class OdomFrame : public rclcpp::Node
{
public:
  OdomFrame()
  : Node("odom_frame"), broadcaster_(this)
  {
    subscription_ = create_subscription<Odometry>(
      "/odom", 10, [this](const Odometry & odometry) {broadcast(odometry);});
  }

private:
  /// Broadcasts the pose, with the stamp of the odometry.
  void broadcast(const Odometry & odometry)
  {
    const auto & pose = odometry.pose.pose;
    geometry_msgs::msg::TransformStamped base;
    base.header.stamp = odometry.header.stamp;
    base.header.frame_id = "odom";
    base.child_frame_id = "base_link";
    base.transform.translation.x = pose.position.x;
    base.transform.translation.y = pose.position.y;
    base.transform.translation.z = pose.position.z;
    base.transform.rotation = pose.orientation;
    broadcaster_.sendTransform(base);
  }

  tf2_ros::TransformBroadcaster broadcaster_;
  rclcpp::Subscription<Odometry>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<OdomFrame>());
  rclcpp::shutdown();
  return 0;
}
