#!/usr/bin/env python3
"""What the manual's commands put into a checkout and is secret is taken neither by `git add -A` nor by `docker build`.

Git reads both ignore files here. It reads more into a bare name than Docker does (any folder, not just the first), so names in
folders count only if a pattern covers them by `**/`.
"""

import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = sys.argv.pop(1)


def run(*command, cwd):
    return subprocess.run([str(part) for part in command], cwd=cwd, check=True, capture_output=True, text=True).stdout


class IgnoredSecrets(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.tree = pathlib.Path(scratch.name)
        run("git", "init", "--quiet", cwd=self.tree)
        # docs/service.md, deploy/new-keys, and somebody's own choice.
        for folder in ("keys", "deploy/keys", "elsewhere/our-keys"):
            (self.tree / folder).mkdir(parents=True)
            run(PROGRAM, "keys", "new", self.tree / folder, cwd=self.tree)
        for file in ("state/my-service/learner/checkpoints/step-1/state.json", "kept.txt"):
            (self.tree / file).parent.mkdir(parents=True, exist_ok=True)
            (self.tree / file).write_text("{}\n")
        self.secrets = sorted(str(path.relative_to(self.tree)) for path in self.tree.rglob("*.key"))
        self.assertGreaterEqual(len(self.secrets), 12)

    def taken(self, ignore_file):
        listed = run("git", "ls-files", "--others", f"--exclude-from={ROOT / ignore_file}", cwd=self.tree).splitlines()
        self.assertIn("kept.txt", listed)
        return listed

    def test_neither_git_nor_docker_takes_a_secret_key_or_state(self):
        for ignore_file in (".gitignore", ".dockerignore"):
            with self.subTest(ignore_file):
                self.assertEqual([file for file in self.taken(ignore_file) if file.endswith(".key") or file.startswith("state/")], [])

    def test_keys_in_any_folder_are_left_out_of_an_image(self):
        self.assertIn("**/*.key", (ROOT / ".dockerignore").read_text().splitlines())


if __name__ == "__main__":
    unittest.main()
