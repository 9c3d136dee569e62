#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "geometry_msgs/msg/twist.hpp"
#include "rclcpp/rclcpp.hpp"
#include "turtlesim/msg/pose.hpp"
#include "turtlesim/srv/kill.hpp"
#include "turtlesim/srv/spawn.hpp"

constexpr double CAUGHT = 0.4;
constexpr double AHEAD = 0.2;
constexpr double LINEAR_GAIN = 1.5, MOST_LINEAR = 2.0;
constexpr double ANGULAR_GAIN = 4.0, MOST_ANGULAR = 3.0;

/// The same angle from -pi to pi.
double wrap(double angle)
{
  return std::atan2(std::sin(angle), std::cos(angle));
}

/// Hunts the nearest turtle.
class TurtleCatch : public rclcpp::Node
{
public:
  TurtleCatch()
  : Node("turtle_catch")
  {
    const auto places = declare_parameter<std::vector<double>>("places");
    kill_ = create_client<turtlesim::srv::Kill>("/kill");
    spawn_ = create_client<turtlesim::srv::Spawn>("/spawn");
    spawn_->wait_for_service();
    missing_ = places.size() / 2;
    for (std::size_t i = 0; i + 1 < places.size(); i += 2) {
      auto request = std::make_shared<turtlesim::srv::Spawn::Request>();
      request->x = static_cast<float>(places[i]);
      request->y = static_cast<float>(places[i + 1]);
      request->name = "prey" + std::to_string(i / 2 + 1);
      prey_[request->name] = {places[i], places[i + 1]};
      spawn_->async_send_request(
        request, [this](rclcpp::Client<turtlesim::srv::Spawn>::SharedFuture) {--missing_;});
    }
    publisher_ = create_publisher<geometry_msgs::msg::Twist>("/turtle1/cmd_vel", 10);
    subscription_ = create_subscription<turtlesim::msg::Pose>(
      "/turtle1/pose", 10, [this](turtlesim::msg::Pose::ConstSharedPtr pose) {hunt(*pose);});
  }

private:
  /// Drive to the target, and choose the next one when it is caught.
  void hunt(const turtlesim::msg::Pose & pose)
  {
    geometry_msgs::msg::Twist command;
    if (missing_ == 0 && !prey_.empty()) {
      if (target_.empty()) {
        target_ = std::min_element(
          prey_.begin(), prey_.end(), [&](const auto & a, const auto & b) {
            return distance(pose, a.first) < distance(pose, b.first);
          })->first;
      }
      if (distance(pose, target_) < CAUGHT) {
        capture();
      } else {
        steer(command, pose);
      }
    }
    publisher_->publish(command);
  }

  /// How far a turtle is.
  double distance(const turtlesim::msg::Pose & pose, const std::string & name) const
  {
    const auto & [x, y] = prey_.at(name);
    return std::hypot(x - pose.x, y - pose.y);
  }

  /// Kill the target.
  void capture()
  {
    auto request = std::make_shared<turtlesim::srv::Kill::Request>();
    request->name = target_;
    kill_->async_send_request(request);
    prey_.erase(target_);
    target_.clear();
  }

  /// Turn to the target, and drive when it is ahead.
  void steer(geometry_msgs::msg::Twist & command, const turtlesim::msg::Pose & pose)
  {
    const auto & [x, y] = prey_.at(target_);
    const double error = wrap(std::atan2(y - pose.y, x - pose.x) - pose.theta);
    command.angular.z = std::clamp(ANGULAR_GAIN * error, -MOST_ANGULAR, MOST_ANGULAR);
    if (std::abs(error) < AHEAD) {
      command.linear.x = std::min(LINEAR_GAIN * distance(pose, target_), MOST_LINEAR);
    }
  }

  std::map<std::string, std::pair<double, double>> prey_;
  std::string target_;
  std::size_t missing_ = 0;
  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr publisher_;
  rclcpp::Client<turtlesim::srv::Kill>::SharedPtr kill_;
  rclcpp::Client<turtlesim::srv::Spawn>::SharedPtr spawn_;
  rclcpp::Subscription<turtlesim::msg::Pose>::SharedPtr subscription_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<TurtleCatch>());
  rclcpp::shutdown();
  return 0;
}
