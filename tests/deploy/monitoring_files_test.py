#!/usr/bin/env python3
"""Rules, alerts and dashboards, as far as that can be told without a running service."""

import json
import re
import subprocess
import sys
import tempfile
import unittest
import pathlib

import monitoring
from monitoring import DASHBOARDS, GRAFANA, PROMETHEUS, ROOT

PAGE = (ROOT / "docs/metrics.md").read_text()
MANUAL = (ROOT / "docs/operations.md").read_text()
ALERTS = monitoring.rules("alert-rules.yml")
RECORDS = monitoring.rules("recording-rules.yml")
HISTOGRAM = ("_bucket", "_sum", "_count")


def promtool(*arguments):
    monitoring.require("promtool")
    return subprocess.run(["promtool", *map(str, arguments)], capture_output=True, text=True)


def metrics_of_page():
    names = set()
    for name, kind in re.findall(r"^\| `(\w+)` \| (\w+) \|", PAGE, re.M):
        names.update([name + end for end in HISTOGRAM] if kind == "histogram" else [name])
    return names


def unknown_names(expression):
    """Metrics that an expression asks for and nobody shows."""
    bare = re.sub(r'"[^"]*"', "", expression)
    asked = set(re.findall(r"\b(?:slalom|process)_\w+\b", re.sub(r"\b\w+:\w+:\w+\b", "", bare)))
    recorded = set(re.findall(r"\b\w+:\w+:\w+\b", bare))
    return (asked - metrics_of_page()) | (recorded - {name for _, name, _ in RECORDS})


class Rules(unittest.TestCase):
    def test_prometheus_takes_its_files(self):
        for name in ("prometheus.yml", "prometheus-local.yml"):
            checked = promtool("check", "config", PROMETHEUS / name)
            self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)

    def test_every_alert_fires_when_it_should(self):
        tests = ROOT / "tests/deploy/alerts_test.yml"
        ran = promtool("test", "rules", tests)
        self.assertEqual(ran.returncode, 0, ran.stdout + ran.stderr)
        fired = re.findall(r"^\s+- alertname: (\w+)$", tests.read_text(), re.M)
        self.assertEqual(sorted(fired), sorted(name for _, name, _ in ALERTS))

    def test_an_alert_that_does_not_fire_is_seen(self):
        with tempfile.TemporaryDirectory() as directory:
            text = (ROOT / "tests/deploy/alerts_test.yml").read_text()
            text = text.replace("../../deploy/prometheus", str(PROMETHEUS)).replace("'0x8 1x40'", "'0x8 0x40'")
            broken = pathlib.Path(directory) / "alerts_test.yml"
            broken.write_text(text)
            self.assertNotEqual(promtool("test", "rules", broken).returncode, 0)

    def test_every_alert_has_a_section_in_the_manual(self):
        text = (PROMETHEUS / "alert-rules.yml").read_text()
        for _, name, _ in ALERTS:
            self.assertRegex(MANUAL, rf"(?m)^#### {name}$")
            self.assertIn(f"runbook: docs/operations.md#{name.lower()}\n", text)
        self.assertEqual(text.count("summary:"), len(ALERTS))
        self.assertEqual(text.count("severity:"), len(ALERTS))
        described = re.findall(r"(?m)^#### (Slalom\w+)$", MANUAL)
        self.assertEqual(sorted(described), sorted(name for _, name, _ in ALERTS))

    def test_rules_ask_for_what_is_shown(self):
        self.assertGreater(len(ALERTS) + len(RECORDS), 25)
        for _, name, expression in ALERTS + RECORDS:
            self.assertEqual(unknown_names(expression), set(), name)

    def test_unknown_names_are_seen(self):
        self.assertEqual(unknown_names("rate(slalom_nothing_total[1m])"), {"slalom_nothing_total"})
        self.assertEqual(unknown_names("run:slalom_nothing:rate1m"), {"run:slalom_nothing:rate1m"})
        self.assertEqual(unknown_names("rate(slalom_insert_seconds[1m])"), {"slalom_insert_seconds"})
        self.assertEqual(unknown_names("rate(slalom_insert_seconds_bucket[1m])"), set())


class Dashboards(unittest.TestCase):
    def test_they_are_what_the_script_makes(self):
        with tempfile.TemporaryDirectory() as directory:
            subprocess.run([sys.executable, "-B", GRAFANA / "make_dashboards.py", directory], check=True)
            made = {path.name: path.read_text() for path in pathlib.Path(directory).glob("*.json")}
        kept = {path.name: path.read_text() for path in DASHBOARDS.glob("*.json")}
        self.assertEqual(kept, made, "stale: run deploy/grafana/make_dashboards.py")
        self.assertEqual(set(made), {"overview.json", "learning.json", "replay.json", "actors.json", "sweep.json"})

    def test_panels_ask_for_what_is_shown(self):
        for board, panel in monitoring.panels():
            for target in panel["targets"]:
                self.assertEqual(unknown_names(monitoring.as_grafana_sends(target["expr"])), set(),
                                 f"{board}: {panel['title']}")

    def test_every_panel_says_what_it_shows(self):
        for board, panel in monitoring.panels():
            where = f"{board}: {panel['title']}"
            self.assertTrue(panel["description"].endswith("."), where)
            self.assertLessEqual(len(panel["description"]), 90, where)
            self.assertIn(panel["fieldConfig"]["defaults"]["unit"],
                          {"s", "bytes", "percentunit", "ops", "short", "Bps"}, where)
            for target in panel["targets"]:
                if panel["type"] != "stat":
                    self.assertTrue(target["legendFormat"], where)

    def test_units_are_those_of_the_metrics(self):
        for board, panel in monitoring.panels():
            unit = panel["fieldConfig"]["defaults"]["unit"]
            for target in panel["targets"]:
                expression = target["expr"]
                where = f"{board}: {panel['title']}: {expression}"
                seconds = re.search(r"_seconds(_bucket)?\b|:seconds\b", expression) and not re.search(
                    r"_seconds_total", expression)
                self.assertEqual(bool(seconds), unit == "s", where)
                self.assertEqual(bool(re.search(r"_bytes(_total)?\b", expression)), unit in ("bytes", "Bps"), where)
                rate = re.search(r"rate\(|:rate1m", expression) and not re.search(r"_seconds|_bytes|:ratio", expression)
                self.assertEqual(bool(rate), unit == "ops", where)

    def test_panels_lie_side_by_side(self):
        for path in DASHBOARDS.glob("*.json"):
            taken = set()
            board = json.loads(path.read_text())
            for panel in board["panels"]:
                grid = panel["gridPos"]
                cells = {(x, y) for x in range(grid["x"], grid["x"] + grid["w"])
                         for y in range(grid["y"], grid["y"] + grid["h"])}
                self.assertFalse(cells & taken, f"{path.name}: {panel['title']}")
                self.assertLessEqual(grid["x"] + grid["w"], 24, f"{path.name}: {panel['title']}")
                taken |= cells
            self.assertEqual(len({panel["id"] for panel in board["panels"]}), len(board["panels"]))


if __name__ == "__main__":
    unittest.main()
