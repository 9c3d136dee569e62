#!/usr/bin/env bash
# Gradescope runs this once, as root, while it builds the autograder's image.
# It needs Python 3.10 to 3.13: choose the newest Ubuntu that Gradescope offers.
set -euo pipefail

apt-get update
# CMake and a compiler build interface packages; bubblewrap keeps a submission apart.
DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends \
    bubblewrap cmake g++ make python3 python3-venv
cd "${AUTOGRADER_ROOT:-/autograder}/source/rosgrade"
# The locked environment, with ROS 2 Jazzy as wheels.
python3 -m grader.bootstrap
# What submissions need beside the wheels, such as rclcpp for nodes in C++.
.venv/bin/rosgrade underlay add --for @ASSIGNMENT@
