#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include <geometry_msgs/msg/twist.hpp>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/image.hpp>

using geometry_msgs::msg::Twist;
using sensor_msgs::msg::Image;

constexpr double SPEED_M_S = 0.18;
constexpr double GAIN = 2.0;
constexpr int LEAST_PIXELS = 20;

/// How bright each pixel is, from 0 to 255, row by row.
std::vector<int> brightness_of(const Image & image) {
  std::vector<int> found;
  for (std::size_t at = 0; at + 2 < image.data.size(); at += 3) {
    found.push_back((image.data[at] + image.data[at + 1] + image.data[at + 2]) / 3);
  }
  return found;
}

/// Keeps the middle of the line in the middle of the picture.
class LineFollower : public rclcpp::Node {
 public:
  LineFollower() : Node("line_follower") {
    publisher_ = create_publisher<Twist>("/cmd_vel", 10);
    subscription_ = create_subscription<Image>(
      "/camera/image_raw", 10, [this](const Image & image) { take_image(image); });
  }

 private:
  /// Steers towards the line; stops where there is none.
  void take_image(const Image & image) {
    const std::vector<int> pixels = brightness_of(image);
    std::vector<int> sorted = pixels;
    std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
    const int median = sorted[sorted.size() / 2];
    // The lower half shows the floor right before the robot.
    int count = 0;
    double sum = 0.0;
    for (std::size_t pixel = pixels.size() / 2; pixel < pixels.size(); ++pixel) {
      const int brightness = pixels[pixel];
      if (brightness < 0.5 * median) {
        ++count;
        sum += pixel % image.width;
      }
    }
    Twist command;
    if (count >= LEAST_PIXELS) {
      const double half = 0.5 * (image.width - 1);
      const double mean = sum / count;
      const double error = (half - mean) / half;
      command.linear.x = SPEED_M_S * (1.0 - 0.5 * std::abs(error));
      command.angular.z = GAIN * error;
    }
    publisher_->publish(command);
  }

  rclcpp::Publisher<Twist>::SharedPtr publisher_;
  rclcpp::Subscription<Image>::SharedPtr subscription_;
};

/// Runs the node until Ctrl+C.
int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<LineFollower>());
  rclcpp::shutdown();
  return 0;
}
