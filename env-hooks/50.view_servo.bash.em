# Completion of `rosrun view_servo view` for those who type.
case $- in
  *i*)
@[if DEVELSPACE]@
    . "@(CMAKE_CURRENT_SOURCE_DIR)/scripts/completion.bash"
@[else]@
    . "$CATKIN_ENV_HOOK_WORKSPACE/@(CATKIN_PACKAGE_SHARE_DESTINATION)/completion.bash"
@[end if]@
    ;;
esac
