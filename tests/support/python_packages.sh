# Sourced by tests of the Python package.

# make_venv VENV REQUIREMENTS: a virtual environment with Debian's packages and, pinned with hashes, those of the file. Ends the test
# where no index of packages is reached.
make_venv() {
  [[ -x $1/bin/python3 ]] || /usr/bin/python3 -m venv --system-site-packages "$1"
  if ! "$1/bin/pip" install -q --no-deps --require-hashes -r "$2"; then
    echo "SKIPPED: no index of Python packages is reached here"
    exit 0
  fi
}
