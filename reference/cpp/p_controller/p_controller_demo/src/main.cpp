#include <memory>

#include "p_controller_demo/p_controller.hpp"
#include "rclcpp/rclcpp.hpp"

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<PController>());
  rclcpp::shutdown();
  return 0;
}
