// A node that drives ahead and stops in front of an obstacle.

#include <chrono>
#include <functional>
#include <memory>
#include <optional>

#include "geometry_msgs/msg/twist.hpp"
#include "rclcpp/rclcpp.hpp"
#include "sensor_msgs/msg/laser_scan.hpp"

using namespace std::chrono_literals;

constexpr double SPEED = 0.1;          // m/s
constexpr double STOP_DISTANCE = 0.2;  // m
constexpr auto SCAN_TIMEOUT = 1s;

// Drives at 0.1 m/s until the front beam of /scan sees an obstacle at 0.2 m.
class BotController : public rclcpp::Node
{
public:
  BotController()
  : Node("bot_controller")
  {
    publisher_ = this->create_publisher<geometry_msgs::msg::Twist>("/cmd_vel", 10);
    subscription_ = this->create_subscription<sensor_msgs::msg::LaserScan>(
      "/scan", 10, std::bind(&BotController::scan_callback, this, std::placeholders::_1));
    watchdog_ = this->create_wall_timer(
      100ms, std::bind(&BotController::watchdog_callback, this));
  }

private:
  // Drive or stop, by what the front beam measured.
  void scan_callback(const sensor_msgs::msg::LaserScan::SharedPtr scan)
  {
    last_scan_ = this->now();
    const double front = scan->ranges[0];
    // A beam that met nothing reports inf, on the real LDS-01 0.0: neither is an obstacle.
    // Nearer than range_min it reports -inf (REP-117), and that is one.
    if (front != 0.0 && front <= STOP_DISTANCE) {
      drive(0.0);
    } else {
      drive(SPEED);
    }
  }

  // Stop when no scan has come for a while: the robot would drive blindly.
  void watchdog_callback()
  {
    if (last_scan_ && this->now() - *last_scan_ > rclcpp::Duration(SCAN_TIMEOUT)) {
      drive(0.0);
    }
  }

  // Publish a command to drive ahead at a speed in m/s.
  void drive(double speed)
  {
    geometry_msgs::msg::Twist message;
    message.linear.x = speed;
    publisher_->publish(message);
  }

  std::optional<rclcpp::Time> last_scan_;
  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
  rclcpp::Subscription<sensor_msgs::msg::LaserScan>::SharedPtr subscription_;
  rclcpp::TimerBase::SharedPtr watchdog_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<BotController>());
  rclcpp::shutdown();
  return 0;
}
