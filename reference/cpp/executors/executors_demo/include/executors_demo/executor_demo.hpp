// A node whose callbacks report when they start and end.

#pragma once

#include <chrono>
#include <string>

#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/string.hpp"

// Two timers and a subscription that work for a while.
class ExecutorDemo : public rclcpp::Node
{
public:
  // The timers are in a group of this type, and the subscription is in another group.
  explicit ExecutorDemo(rclcpp::CallbackGroupType timer_group_type);

private:
  void timer_1_callback();
  void timer_2_callback();
  void chatter_callback(const std_msgs::msg::String & message);

  // Report the start, work, and report the end.
  void work(const std::string & callback, std::chrono::milliseconds duration);

  // The node itself keeps no more than a weak pointer to its groups.
  rclcpp::CallbackGroup::SharedPtr timer_group_;
  rclcpp::CallbackGroup::SharedPtr chatter_group_;
  rclcpp::Publisher<std_msgs::msg::String>::SharedPtr events_;
  rclcpp::TimerBase::SharedPtr timer_1_;
  rclcpp::TimerBase::SharedPtr timer_2_;
  rclcpp::Subscription<std_msgs::msg::String>::SharedPtr subscription_;
};
