// The decision layer: a managed node that drives the robot.

#include <memory>

#include "geometry_msgs/msg/twist.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"
#include "rclcpp_lifecycle/lifecycle_publisher.hpp"
#include "std_msgs/msg/float64.hpp"

using geometry_msgs::msg::Twist;
using std_msgs::msg::Float64;

constexpr double kFreeM = 0.6;
constexpr double kStopM = 0.3;
constexpr double kSpeedMS = 0.2;
constexpr double kTurnRadS = 0.5;

/// Drives while the way is free, else turns left; stops if the obstacle is too near.
Twist decide(double distance)
{
  Twist command;
  if (distance > kFreeM) {
    command.linear.x = kSpeedMS;
  } else if (distance >= kStopM) {
    command.angular.z = kTurnRadS;
  }
  return command;
}

/// Publishes a command for each distance, while it is active.
class Decision : public rclcpp_lifecycle::LifecycleNode
{
public:
  Decision()
  : LifecycleNode("decision") {}

  /// Creates the publisher, which is silent until the node is active.
  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override
  {
    commands_ = create_publisher<Twist>("/cmd_vel", 10);
    subscription_ = create_subscription<Float64>(
      "/obstacle/distance", 10,
      [this](const Float64 & distance) {commands_->publish(decide(distance.data));});
    return CallbackReturn::SUCCESS;
  }

  /// Stops the robot before the publisher falls silent.
  CallbackReturn on_deactivate(const rclcpp_lifecycle::State & state) override
  {
    commands_->publish(Twist());
    return LifecycleNode::on_deactivate(state);
  }

  /// Destroys what on_configure created.
  CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) override
  {
    subscription_.reset();
    commands_.reset();
    return CallbackReturn::SUCCESS;
  }

private:
  rclcpp_lifecycle::LifecyclePublisher<Twist>::SharedPtr commands_;
  rclcpp::Subscription<Float64>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Decision>()->get_node_base_interface());
  rclcpp::shutdown();
  return 0;
}
