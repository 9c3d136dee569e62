// A node that sends one velocity command to the robot.

#include <memory>

#include "geometry_msgs/msg/twist.hpp"
#include "rclcpp/rclcpp.hpp"

// Publishes one Twist on /cmd_vel, and then stays alive.
class BotPublisher : public rclcpp::Node
{
public:
  BotPublisher()
  : Node("bot_publisher")
  {
    publisher_ = this->create_publisher<geometry_msgs::msg::Twist>("/cmd_vel", 10);
    publish_command();
  }

private:
  // Publish the command: 1.0 m/s ahead while turning left at 0.5 rad/s.
  void publish_command()
  {
    auto message = geometry_msgs::msg::Twist();
    message.linear.x = 1.0;
    message.angular.z = 0.5;
    publisher_->publish(message);
  }

  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<BotPublisher>());
  rclcpp::shutdown();
  return 0;
}
