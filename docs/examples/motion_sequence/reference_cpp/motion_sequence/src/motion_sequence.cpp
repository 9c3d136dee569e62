#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include <geometry_msgs/msg/twist.hpp>
#include <rclcpp/rclcpp.hpp>

using namespace std::chrono_literals;

constexpr double SPEED_M_S = 0.2;
constexpr double TURN_RAD_S = M_PI / 4.0;

/// A command, and how long it lasts.
struct Motion {
  double linear_m_s;
  double angular_rad_s;
  double duration_s;
};

/// Drives straight ahead.
Motion leg(double length_m) { return {SPEED_M_S, 0.0, length_m / SPEED_M_S}; }

/// Turns on the spot, to the left where the angle is positive.
Motion turn(double angle_deg) {
  const double angle_rad = angle_deg * M_PI / 180.0;
  return {0.0, std::copysign(TURN_RAD_S, angle_rad), std::abs(angle_rad) / TURN_RAD_S};
}

/// Drives a sequence of legs and turns by a timer, and then ends.
class MotionSequence : public rclcpp::Node {
 public:
  MotionSequence() : Node("motion_sequence") {
    publisher_ = create_publisher<geometry_msgs::msg::Twist>("/cmd_vel", 10);
    timer_ = create_wall_timer(50ms, [this] { step(); });
  }

 private:
  /// Publishes the command for this moment.
  void step() {
    if (!began_) {
      began_ = now();
    }
    double elapsed_s = (now() - *began_).seconds();
    geometry_msgs::msg::Twist command;
    for (const Motion & motion : sequence_) {
      if (elapsed_s < motion.duration_s) {
        command.linear.x = motion.linear_m_s;
        command.angular.z = motion.angular_rad_s;
        publisher_->publish(command);
        return;
      }
      elapsed_s -= motion.duration_s;
    }
    publisher_->publish(command);
    rclcpp::shutdown();
  }

  const std::vector<Motion> sequence_{
    leg(0.6), turn(90.0), leg(0.4), turn(-90.0), leg(0.4), {0.0, 0.0, 1.0}};
  std::optional<rclcpp::Time> began_;
  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
  rclcpp::TimerBase::SharedPtr timer_;
};

/// Runs the node until the sequence is complete.
int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<MotionSequence>());
  rclcpp::shutdown();
  return 0;
}
