"""Assignments for one test: HEAD needs checks, GOOD is complete."""

HEAD = """\
rosgrade: 1
id: lesson
title: A lesson
packages:
  - name: bot
    executables: [bot_pub]
scenarios:
  - id: run
    launch: [{executable: bot_pub}]
    record: [{topic: /cmd_vel, type: geometry_msgs/msg/Twist}]
    timeout: 5 s
checks:
"""
"""The first check stands in line 13."""

GOOD = HEAD + "  - {id: alive, uses: node.alive, points: 1}\n"
