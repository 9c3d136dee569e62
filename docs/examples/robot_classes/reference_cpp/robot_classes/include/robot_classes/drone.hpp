#pragma once

#include "robot_classes/robot_node.hpp"

/// Flies.
class Drone : public RobotNode {
 public:
  Drone();
  double move() override;
};
