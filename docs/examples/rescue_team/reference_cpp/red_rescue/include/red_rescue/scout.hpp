#pragma once

#include <cstddef>

#include <red_interfaces/msg/victim_report.hpp>

#include "red_rescue/robot_node.hpp"

/// Drives on, and reports one victim after the other.
class Scout : public RobotNode {
 public:
  Scout();

  /// Drives slowly, so that no victim is missed.
  double speed() override;

 private:
  /// Reports the next victim.
  void report();

  std::size_t reported_{0};
  rclcpp::Publisher<red_interfaces::msg::VictimReport>::SharedPtr reports_;
  rclcpp::TimerBase::SharedPtr timer_;
};
