#pragma once

#include <cstdint>
#include <memory>
#include <set>

#include <rclcpp_action/rclcpp_action.hpp>
#include <red_interfaces/action/rescue.hpp>
#include <red_interfaces/srv/assign_victim.hpp>

#include "red_rescue/robot_node.hpp"

/// Keeps the victims that it is given, and drives to one with each goal.
class Medic : public RobotNode {
 public:
  Medic();

  /// Drives only to a victim.
  double speed() override;

 private:
  using AssignVictim = red_interfaces::srv::AssignVictim;
  using Rescue = red_interfaces::action::Rescue;
  using GoalHandle = rclcpp_action::ServerGoalHandle<Rescue>;

  /// Keeps a victim whose severity is possible.
  void assign(const AssignVictim::Request & request, AssignVictim::Response & response);

  /// Accepts only a victim that was assigned.
  rclcpp_action::GoalResponse decide(const Rescue::Goal & goal) const;

  /// Ends the goal before this one, then begins to drive.
  void start(const std::shared_ptr<GoalHandle> & handle);

  /// Drives for one step, and ends where the goal says, or when it is canceled.
  void step();

  double driven_{0.0};
  std::set<std::int32_t> assigned_;
  std::shared_ptr<GoalHandle> handle_;
  rclcpp::Service<AssignVictim>::SharedPtr service_;
  rclcpp_action::Server<Rescue>::SharedPtr server_;
  rclcpp::TimerBase::SharedPtr timer_;
};
