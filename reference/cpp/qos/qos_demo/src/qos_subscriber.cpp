// A node that gets the last messages even if it joins late.

#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/int64.hpp"

// Logs every number that it receives.
class QosSubscriber : public rclcpp::Node
{
public:
  QosSubscriber()
  : Node("qos_subscriber")
  {
    auto profile = rclcpp::QoS(rclcpp::KeepLast(10));
    profile.reliable();
    profile.transient_local();
    subscription_ = this->create_subscription<std_msgs::msg::Int64>(
      "/qos_demo", profile,
      [this](const std_msgs::msg::Int64 & message) {message_callback(message);});
  }

private:
  // Log the number.
  void message_callback(const std_msgs::msg::Int64 & message)
  {
    RCLCPP_INFO_STREAM(this->get_logger(), "Received: " << message.data);
  }

  rclcpp::Subscription<std_msgs::msg::Int64>::SharedPtr subscription_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<QosSubscriber>());
  rclcpp::shutdown();
  return 0;
}
