#pragma once

#include "robot_classes/robot_node.hpp"

/// Drives on wheels.
class Rover : public RobotNode {
 public:
  Rover();
  double move() override;
};
