// Run the timers at the same time, but one chatter callback after the other.

#include <memory>

#include "executors_demo/executor_demo.hpp"
#include "rclcpp/rclcpp.hpp"

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  auto node = std::make_shared<ExecutorDemo>(rclcpp::CallbackGroupType::Reentrant);
  rclcpp::executors::MultiThreadedExecutor executor(rclcpp::ExecutorOptions(), 4);
  executor.add_node(node);
  executor.spin();
  rclcpp::shutdown();
  return 0;
}
