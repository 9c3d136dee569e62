// A node that sends a velocity command to the robot again and again.

#ifndef BOT_PUBLISHER__BOT_PUBLISHER_HPP_
#define BOT_PUBLISHER__BOT_PUBLISHER_HPP_

#include "geometry_msgs/msg/twist.hpp"
#include "rclcpp/rclcpp.hpp"

// Publishes a Twist on /cmd_vel every 300 ms.
class BotPublisher : public rclcpp::Node
{
public:
  BotPublisher();

private:
  void timer_callback();

  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};

#endif  // BOT_PUBLISHER__BOT_PUBLISHER_HPP_
