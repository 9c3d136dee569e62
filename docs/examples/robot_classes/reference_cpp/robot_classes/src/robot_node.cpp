#include "robot_classes/robot_node.hpp"

#include <chrono>

using namespace std::chrono_literals;

RobotNode::RobotNode(const std::string & name) : Node("robot", name) {
  publisher_ = create_publisher<std_msgs::msg::Float64>("travelled", 10);
  timer_ = create_wall_timer(200ms, [this] { step(); });
}

void RobotNode::step() {
  travelled_ += move();
  std_msgs::msg::Float64 message;
  message.data = travelled_;
  publisher_->publish(message);
}
