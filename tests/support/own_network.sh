# Sourced by tests of the nodes of ROS.

# in_own_network COMMAND...: in a network of its own if the user may make one, and with processes of its own: none outlives the test,
# however it ends.
in_own_network() {
  local own=(unshare --net --pid --fork --kill-child)
  if ! "${own[@]}" true 2>/dev/null; then
    own=(unshare --user --map-root-user --net --pid --fork --kill-child)
    "${own[@]}" true 2>/dev/null || exec "$@"
  fi
  exec "${own[@]}" bash -c 'ip link set lo up; "$@"; exit $?' bash "$@"
}
