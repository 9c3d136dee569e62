// Run one callback at a time.

#include <memory>

#include "executors_demo/executor_demo.hpp"
#include "rclcpp/rclcpp.hpp"

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  auto node = std::make_shared<ExecutorDemo>(rclcpp::CallbackGroupType::MutuallyExclusive);
  rclcpp::executors::SingleThreadedExecutor executor;
  executor.add_node(node);
  executor.spin();
  rclcpp::shutdown();
  return 0;
}
