#include "red_rescue/robot_node.hpp"

#include <chrono>

using namespace std::chrono_literals;

RobotNode::RobotNode(const std::string & name) : Node(name) {
  publisher_ = create_publisher<geometry_msgs::msg::Twist>("cmd_vel", 10);
  timer_ = create_wall_timer(100ms, [this] { drive(); });
}

void RobotNode::drive() {
  geometry_msgs::msg::Twist command;
  command.linear.x = speed();
  publisher_->publish(command);
}
