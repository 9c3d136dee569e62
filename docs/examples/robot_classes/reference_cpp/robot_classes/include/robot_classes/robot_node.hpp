#pragma once

#include <string>

#include <rclcpp/rclcpp.hpp>
#include <std_msgs/msg/float64.hpp>

/// A robot that moves step by step, and publishes how far it has moved.
class RobotNode : public rclcpp::Node {
 public:
  explicit RobotNode(const std::string & name);

  /// Moves once; says how far, in m.
  virtual double move() = 0;

  /// Moves once, and publishes the way so far.
  void step();

 private:
  double travelled_{0.0};
  rclcpp::Publisher<std_msgs::msg::Float64>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};
