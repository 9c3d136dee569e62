#include <memory>

#include <rclcpp/rclcpp.hpp>

#include "robot_classes/drone.hpp"
#include "robot_classes/rover.hpp"

/// Runs both robots until Ctrl+C.
int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  auto rover = std::make_shared<Rover>();
  auto drone = std::make_shared<Drone>();
  rclcpp::executors::SingleThreadedExecutor executor;
  executor.add_node(rover);
  executor.add_node(drone);
  executor.spin();
  rclcpp::shutdown();
  return 0;
}
