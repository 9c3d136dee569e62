// The perception layer: a managed node that finds the nearest obstacle ahead.

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>

#include "geometry_msgs/msg/point_stamped.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"
#include "rclcpp_lifecycle/lifecycle_publisher.hpp"
#include "sensor_msgs/msg/laser_scan.hpp"
#include "std_msgs/msg/float64.hpp"

using geometry_msgs::msg::PointStamped;
using sensor_msgs::msg::LaserScan;
using std_msgs::msg::Float64;

constexpr double kAhead = M_PI;
constexpr double kHalfWidth = M_PI / 6.0;

/// The angle between a beam and the way ahead, from 0 to pi.
double off_ahead(double angle)
{
  return std::abs(std::remainder(angle - kAhead, 2.0 * M_PI));
}

/// Publishes the distance and the place of the nearest obstacle ahead, while it is active.
class Perception : public rclcpp_lifecycle::LifecycleNode
{
public:
  Perception()
  : LifecycleNode("perception") {}

  /// Creates the publishers, which are silent until the node is active.
  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override
  {
    distances_ = create_publisher<Float64>("/obstacle/distance", 10);
    points_ = create_publisher<PointStamped>("/obstacle/point", 10);
    subscription_ = create_subscription<LaserScan>(
      "/scan", rclcpp::SensorDataQoS(), [this](const LaserScan & scan) {perceive(scan);});
    return CallbackReturn::SUCCESS;
  }

  /// Destroys what on_configure created.
  CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) override
  {
    subscription_.reset();
    distances_.reset();
    points_.reset();
    return CallbackReturn::SUCCESS;
  }

private:
  /// Publishes the nearest obstacle ahead.
  void perceive(const LaserScan & scan)
  {
    Float64 nearest;
    nearest.data = std::numeric_limits<double>::infinity();
    double nearest_angle = kAhead;
    for (std::size_t index = 0; index < scan.ranges.size(); ++index) {
      const float distance = scan.ranges[index];
      const double angle = scan.angle_min + index * scan.angle_increment;
      const bool is_measured = scan.range_min <= distance && distance <= scan.range_max;
      if (is_measured && off_ahead(angle) <= kHalfWidth && distance < nearest.data) {
        nearest.data = distance;
        nearest_angle = angle;
      }
    }
    distances_->publish(nearest);
    if (std::isfinite(nearest.data)) {
      PointStamped obstacle;
      obstacle.header = scan.header;
      obstacle.point.x = nearest.data * std::cos(nearest_angle);
      obstacle.point.y = nearest.data * std::sin(nearest_angle);
      points_->publish(obstacle);
    }
  }

  rclcpp_lifecycle::LifecyclePublisher<Float64>::SharedPtr distances_;
  rclcpp_lifecycle::LifecyclePublisher<PointStamped>::SharedPtr points_;
  rclcpp::Subscription<LaserScan>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Perception>()->get_node_base_interface());
  rclcpp::shutdown();
  return 0;
}
