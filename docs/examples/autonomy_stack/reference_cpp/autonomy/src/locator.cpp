// A node that says where the obstacle is in the odom frame.

#include <memory>

#include "geometry_msgs/msg/point_stamped.hpp"
#include "rclcpp/rclcpp.hpp"
#include "tf2/exceptions.hpp"
#include "tf2_geometry_msgs/tf2_geometry_msgs.hpp"
#include "tf2_ros/buffer.h"
#include "tf2_ros/transform_listener.h"

using geometry_msgs::msg::PointStamped;

/// Transforms the nearest obstacle from the frame of the laser to odom.
class Locator : public rclcpp::Node
{
public:
  Locator()
  : Node("locator"), buffer_(get_clock()), listener_(buffer_)
  {
    publisher_ = create_publisher<PointStamped>("/obstacle/in_odom", 10);
    subscription_ = create_subscription<PointStamped>(
      "/obstacle/point", 10, [this](const PointStamped & obstacle) {locate(obstacle);});
  }

private:
  /// Publishes the obstacle in odom, once the frames are known.
  void locate(const PointStamped & obstacle)
  {
    PointStamped located;
    try {
      const auto transform =
        buffer_.lookupTransform("odom", obstacle.header.frame_id, tf2::TimePointZero);
      tf2::doTransform(obstacle, located, transform);
    } catch (const tf2::TransformException & error) {
      RCLCPP_INFO_THROTTLE(
        get_logger(), *get_clock(), 1000, "no transform yet: %s", error.what());
      return;
    }
    publisher_->publish(located);
  }

  tf2_ros::Buffer buffer_;
  tf2_ros::TransformListener listener_;
  rclcpp::Publisher<PointStamped>::SharedPtr publisher_;
  rclcpp::Subscription<PointStamped>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Locator>());
  rclcpp::shutdown();
  return 0;
}
