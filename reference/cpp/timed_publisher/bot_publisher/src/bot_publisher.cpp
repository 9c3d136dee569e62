#include "bot_publisher/bot_publisher.hpp"

#include <chrono>
#include <functional>
#include <memory>

using namespace std::chrono_literals;

BotPublisher::BotPublisher()
: Node("bot_publisher")
{
  publisher_ = this->create_publisher<geometry_msgs::msg::Twist>("/cmd_vel", 10);
  timer_ = this->create_wall_timer(300ms, std::bind(&BotPublisher::timer_callback, this));
}

// Publish the command: 1.0 m/s ahead while turning left at 0.5 rad/s.
void BotPublisher::timer_callback()
{
  auto message = geometry_msgs::msg::Twist();
  message.linear.x = 1.0;
  message.angular.z = 0.5;
  publisher_->publish(message);
}

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<BotPublisher>());
  rclcpp::shutdown();
  return 0;
}
