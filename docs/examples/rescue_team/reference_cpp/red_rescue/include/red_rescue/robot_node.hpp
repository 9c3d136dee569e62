#pragma once

#include <string>

#include <geometry_msgs/msg/twist.hpp>
#include <rclcpp/rclcpp.hpp>

/// A robot that drives as fast as its class says.
class RobotNode : public rclcpp::Node {
 public:
  explicit RobotNode(const std::string & name);

  /// Says how fast the robot drives now, in m/s.
  virtual double speed() = 0;

 private:
  /// Commands the speed.
  void drive();

  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};
