#include "red_rescue/scout.hpp"

#include <chrono>
#include <iterator>
#include <memory>

using namespace std::chrono_literals;

namespace {

struct Victim {
  double x, y, severity;
};
constexpr Victim kVictims[] = {{1.0, 0.5, 0.2}, {3.0, -1.0, 0.9}, {-2.0, 4.0, 0.5}};

}  // namespace

Scout::Scout() : RobotNode("scout") {
  reports_ = create_publisher<red_interfaces::msg::VictimReport>("/victims", 10);
  timer_ = create_wall_timer(500ms, [this] { report(); });
}

double Scout::speed() { return 0.2; }

void Scout::report() {
  const Victim & victim = kVictims[reported_++ % std::size(kVictims)];
  red_interfaces::msg::VictimReport message;
  message.pose.position.x = victim.x;
  message.pose.position.y = victim.y;
  message.severity = victim.severity;
  reports_->publish(message);
}

int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<Scout>());
  rclcpp::shutdown();
  return 0;
}
