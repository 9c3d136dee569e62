// A node that drives to a goal with a proportional controller.

#pragma once

#include "geometry_msgs/msg/twist.hpp"
#include "nav_msgs/msg/odometry.hpp"
#include "rclcpp/rclcpp.hpp"

// Drives to goal_x, goal_y and then turns to goal_theta.
class PController : public rclcpp::Node
{
public:
  PController();

private:
  // Compute and publish the command for where the robot is now.
  void odom_callback(const nav_msgs::msg::Odometry & odometry);

  double goal_x_;           // m
  double goal_y_;           // m
  double goal_theta_;       // rad
  double goal_tolerance_;   // m
  double angle_tolerance_;  // rad
  bool arrived_ = false;
  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
  rclcpp::Subscription<nav_msgs::msg::Odometry>::SharedPtr subscription_;
};
