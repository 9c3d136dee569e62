#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include <geometry_msgs/msg/twist.hpp>
#include <rclcpp/rclcpp.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <sensor_msgs/msg/laser_scan.hpp>

using geometry_msgs::msg::Twist;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::LaserScan;

constexpr double SPEED_M_S = 0.18;
constexpr double SEARCH_RAD_S = 0.6;
constexpr double GAIN = 1.0;
constexpr double STOP_M = 0.4;
constexpr int LEAST_PIXELS = 15;

/// Turns until the box is in sight, then drives towards it.
class BoxFinder : public rclcpp::Node {
 public:
  BoxFinder() : Node("box_finder") {
    publisher_ = create_publisher<Twist>("/cmd_vel", 10);
    scan_subscription_ = create_subscription<LaserScan>(
      "/scan", 10, [this](const LaserScan & scan) { take_scan(scan); });
    image_subscription_ = create_subscription<Image>(
      "/camera/image_raw", 10, [this](const Image & image) { take_image(image); });
  }

 private:
  /// Keeps how far the nearest thing ahead is.
  void take_scan(const LaserScan & scan) {
    const auto begin = std::min_element(scan.ranges.begin(), scan.ranges.begin() + 10);
    const auto end = std::min_element(scan.ranges.end() - 10, scan.ranges.end());
    const double nearest = std::min(*begin, *end);
    ahead_m_ = nearest;
  }

  /// Searches, approaches or stops.
  void take_image(const Image & image) {
    int count = 0;
    double sum = 0.0;
    for (std::size_t at = 0; at + 2 < image.data.size(); at += 3) {
      const int red = image.data[at];
      const int green = image.data[at + 1];
      const int blue = image.data[at + 2];
      if (red > 60 && red > 2 * green && red > 2 * blue) {
        ++count;
        sum += at / 3 % image.width;
      }
    }
    const bool is_seen = count >= LEAST_PIXELS;
    if (is_seen && ahead_m_ < STOP_M) {
      is_there_ = true;
    }
    Twist command;
    if (!is_there_ && is_seen) {
      const double half = 0.5 * (image.width - 1);
      const double mean = sum / count;
      const double error = (half - mean) / half;
      command.linear.x = SPEED_M_S * (1.0 - std::abs(error));
      command.angular.z = GAIN * error;
    } else if (!is_there_) {
      command.angular.z = SEARCH_RAD_S;
    }
    publisher_->publish(command);
  }

  double ahead_m_ = std::numeric_limits<double>::infinity();
  bool is_there_ = false;
  rclcpp::Publisher<Twist>::SharedPtr publisher_;
  rclcpp::Subscription<LaserScan>::SharedPtr scan_subscription_;
  rclcpp::Subscription<Image>::SharedPtr image_subscription_;
};

/// Runs the node until Ctrl+C.
int main(int argc, char ** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<BoxFinder>());
  rclcpp::shutdown();
  return 0;
}
