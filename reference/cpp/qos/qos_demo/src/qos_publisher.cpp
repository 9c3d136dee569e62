// A node that counts, and keeps its last messages for late joiners.

#include <chrono>
#include <cstdint>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/int64.hpp"

using namespace std::chrono_literals;

// Publishes 0, 1, 2 and so on.
class QosPublisher : public rclcpp::Node
{
public:
  QosPublisher()
  : Node("qos_publisher")
  {
    auto profile = rclcpp::QoS(rclcpp::KeepLast(10));
    profile.reliable();
    profile.transient_local();
    publisher_ = this->create_publisher<std_msgs::msg::Int64>("/qos_demo", profile);
    timer_ = this->create_wall_timer(500ms, [this]() {timer_callback();});
  }

private:
  // Publish the next number.
  void timer_callback()
  {
    auto message = std_msgs::msg::Int64();
    message.data = count_;
    publisher_->publish(message);
    count_++;
  }

  rclcpp::Publisher<std_msgs::msg::Int64>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
  int64_t count_ = 0;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<QosPublisher>());
  rclcpp::shutdown();
  return 0;
}
