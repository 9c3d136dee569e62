// A node that converts rotations from one way to write them into another.

#include <functional>
#include <memory>

#include "geometry_msgs/msg/quaternion.hpp"
#include "geometry_msgs/msg/vector3.hpp"
#include "quaternion_demo/rotations.hpp"
#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/float64_multi_array.hpp"

using geometry_msgs::msg::Quaternion;
using geometry_msgs::msg::Vector3;
using std::placeholders::_1;
using std_msgs::msg::Float64MultiArray;

// Answers each message on three topics with the same rotation, written in another way.
class QuaternionDemo : public rclcpp::Node
{
public:
  QuaternionDemo()
  : Node("quaternion_demo")
  {
    quaternion_publisher_ = this->create_publisher<Quaternion>("/quaternion", 10);
    orientation_publisher_ = this->create_publisher<Quaternion>("/orientation", 10);
    rpy_publisher_ = this->create_publisher<Vector3>("/rpy_out", 10);

    axis_angle_subscription_ = this->create_subscription<Float64MultiArray>(
      "/axis_angle", 10, std::bind(&QuaternionDemo::axis_angle_callback, this, _1));
    rpy_subscription_ = this->create_subscription<Vector3>(
      "/rpy", 10, std::bind(&QuaternionDemo::rpy_callback, this, _1));
    quaternion_subscription_ = this->create_subscription<Quaternion>(
      "/quaternion_in", 10, std::bind(&QuaternionDemo::quaternion_callback, this, _1));
  }

private:
  // Answer [x, y, z, angle] on /quaternion.
  void axis_angle_callback(const Float64MultiArray::SharedPtr message)
  {
    const auto & data = message->data;
    quaternion_publisher_->publish(from_axis_angle(data[0], data[1], data[2], data[3]));
  }

  // Answer roll, pitch and yaw on /orientation.
  void rpy_callback(const Vector3::SharedPtr message)
  {
    orientation_publisher_->publish(from_rpy(message->x, message->y, message->z));
  }

  // Answer a quaternion on /rpy_out.
  void quaternion_callback(const Quaternion::SharedPtr message)
  {
    rpy_publisher_->publish(to_rpy(*message));
  }

  rclcpp::Publisher<Quaternion>::SharedPtr quaternion_publisher_;
  rclcpp::Publisher<Quaternion>::SharedPtr orientation_publisher_;
  rclcpp::Publisher<Vector3>::SharedPtr rpy_publisher_;
  rclcpp::Subscription<Float64MultiArray>::SharedPtr axis_angle_subscription_;
  rclcpp::Subscription<Vector3>::SharedPtr rpy_subscription_;
  rclcpp::Subscription<Quaternion>::SharedPtr quaternion_subscription_;
};

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<QuaternionDemo>());
  rclcpp::shutdown();
  return 0;
}
