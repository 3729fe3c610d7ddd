#!/usr/bin/env python3
"""The scripts of the image with stand-ins for the program, and what compose.yml and stack.yml say of restarts and of the network."""

import fcntl
import http.server
import os
import pathlib
import re
import signal
import subprocess
import tempfile
import threading
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
IMAGE = ROOT / "deploy/image"


class StandIns(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.bin, self.state = pathlib.Path(scratch.name) / "bin", pathlib.Path(scratch.name) / "state"
        self.bin.mkdir()
        self.stand_in("slalom", 'echo "$@"; exit "${STAND_IN_CODE:-0}"')
        self.environment = dict(os.environ, PATH=f"{self.bin}:{os.environ['PATH']}", SLALOM_STATE=str(self.state))

    def stand_in(self, name, script):
        path = self.bin / name
        path.write_text(f"#!/usr/bin/env bash\n{script}\n")
        path.chmod(0o755)


class Scripts(StandIns):
    def role(self, *arguments, **environment):
        return subprocess.run([IMAGE / "role", *arguments], env={**self.environment, **environment}, capture_output=True, text=True,
                              timeout=60, check=False)

    def test_an_actor_takes_the_first_place_that_no_other_has(self):
        for place in (1, 2):
            (self.state / str(place)).mkdir(parents=True)
        with open(self.state / "1/place.lock", "w") as held:
            fcntl.flock(held, fcntl.LOCK_EX)
            ran = self.role("actor")
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertIn(f"service.state={self.state}/2", ran.stdout)
        self.assertIn(f"--name {(self.state / '2/name').read_text().strip()}", ran.stdout)

    def test_an_actor_whose_volume_is_its_own_needs_no_lock(self):
        self.stand_in("flock", "exit 71")
        for role in ("actor", "evaluator"):
            ran = self.role(role, SLALOM_NAME=f"{role}-3")
            self.assertEqual(ran.returncode, 0, ran.stderr)
            self.assertIn(f"service.state={self.state} ", ran.stdout)
            self.assertIn(f"--name {role}-3", ran.stdout)
        self.assertNotIn("--name", self.role("replay", SLALOM_NAME="replay-0").stdout)

    def test_a_volume_without_locks_is_named(self):
        self.stand_in("flock", "exit 71")  # As util-linux where the system refuses.
        ran = self.role("actor")
        self.assertEqual(ran.returncode, 1)
        self.assertIn(f"{self.state}/1/place.lock", ran.stderr)
        self.assertIn("71", ran.stderr)
        self.assertEqual([path.name for path in self.state.iterdir()], ["1"])

    def test_a_learner_that_would_end_the_same_way_is_not_started_again(self):
        for code, expected in ((0, 0), (3, 0), (4, 0), (1, 1), (2, 2), (137, 137)):
            self.assertEqual(self.role("learner", STAND_IN_CODE=str(code)).returncode, expected, code)
            self.assertEqual(self.role("learner", STAND_IN_CODE=str(code), SLALOM_EXIT_CODES="as-they-are").returncode, code)
        for code in (0, 1, 3):
            self.assertEqual(self.role("replay", STAND_IN_CODE=str(code)).returncode, code)

    def test_a_role_that_was_told_to_stop_comes_back_with_its_machine(self):
        self.stand_in("slalom", "trap 'echo saved; exit 0' TERM; echo started; while :; do read -rt 1 <> <(:) || :; done")
        for role in ("learner", "actor"):
            process = subprocess.Popen([IMAGE / "role", role], env=self.environment, stdout=subprocess.PIPE, text=True)
            self.assertEqual(process.stdout.readline(), "started\n")
            process.send_signal(signal.SIGTERM)
            self.assertEqual(process.stdout.readline(), "saved\n")
            self.assertEqual(process.wait(timeout=60), 143)
            process.stdout.close()

    def test_a_role_that_was_told_to_stop_and_fails_says_so(self):
        self.stand_in("slalom", "trap 'exit 1' TERM; echo started; while :; do read -rt 1 <> <(:) || :; done")
        process = subprocess.Popen([IMAGE / "role", "actor"], env=self.environment, stdout=subprocess.PIPE, text=True)
        self.assertEqual(process.stdout.readline(), "started\n")
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(timeout=60), 1)
        process.stdout.close()

    def test_health_is_asked_where_no_stranger_is(self):
        status = [200]

        class Role(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(status[0] if self.path == "/healthy" else 404)
                self.end_headers()

            def log_message(self, *_):
                pass

        server = http.server.HTTPServer(("127.0.0.1", 0), Role)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.server_close)
        self.addCleanup(server.shutdown)

        def healthy(*arguments, port=server.server_port):
            return subprocess.run([IMAGE / "healthy", *arguments], env=dict(os.environ, SLALOM_HEALTH_PORT=str(port)),
                                  capture_output=True, timeout=60, check=False).returncode == 0

        self.assertTrue(healthy())
        status[0] = 503
        self.assertFalse(healthy())
        self.assertTrue(healthy("--answers"))
        status[0] = 500
        self.assertFalse(healthy("--answers"))
        asked = re.search(r"SLALOM_HEALTH_PORT:-(\d+)", (IMAGE / "healthy").read_text()).group(1)
        self.assertIn(f"service.health=127.0.0.1:{asked}", (IMAGE / "role").read_text())


class Status(StandIns):
    def test_status_sees_no_key_but_the_operators(self):
        self.stand_in("docker", 'printf "%s\\n" "$@"')
        keys = self.state / "keys"
        keys.mkdir(parents=True)
        ran = subprocess.run([ROOT / "deploy/status", "--json"], env=dict(self.environment, SLALOM_KEYS=str(keys)), capture_output=True,
                             text=True, timeout=60, check=True)
        mounted = re.findall(r"^(\S+):/run/secrets\S*$", ran.stdout, re.M)
        self.assertEqual(sorted(pathlib.Path(path.split(":")[0]).name for path in mounted), ["operator.key", "operator.pub", "replay.pub"])


class Files(unittest.TestCase):
    def test_a_role_writes_to_its_volume_alone(self):
        role = re.search(r"x-role: &role\n((  .*\n)*)", (ROOT / "deploy/compose.yml").read_text()).group(1)
        for line in ("read_only: true", "cap_drop: [ALL]", 'security_opt: ["no-new-privileges:true"]'):
            self.assertIn(f"  {line}\n", role)

    def test_what_ended_well_stays_so(self):
        self.assertRegex((ROOT / "deploy/compose.yml").read_text(), r"x-role: &role\n(  .*\n)*  restart: on-failure\b")
        self.assertRegex((ROOT / "deploy/stack.yml").read_text(), r"restart_policy: \{condition: on-failure\b")

    def test_the_network_between_machines_is_encrypted(self):
        self.assertRegex((ROOT / "deploy/stack.yml").read_text(), r'driver: overlay\n(    .*\n)*    driver_opts: \{encrypted: "true"\}')


if __name__ == "__main__":
    unittest.main()
