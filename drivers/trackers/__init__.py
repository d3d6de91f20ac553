"""Where the robot is: a folder for each kind of tracker."""
