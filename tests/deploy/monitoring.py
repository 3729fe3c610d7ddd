"""What the tests of rules and dashboards share: the expressions in them, and a Prometheus of their own."""

import json
import math
import pathlib
import re
import shutil
import socket
import subprocess
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROMETHEUS = ROOT / "deploy/prometheus"
GRAFANA = ROOT / "deploy/grafana"
DASHBOARDS = GRAFANA / "dashboards"


def require(program):
    if shutil.which(program) is None:
        raise SystemExit(f"{program} is not installed; Debian's package prometheus brings it")


def rules(name):
    """(kind, name, expression) of each rule of a file: `record` or `alert`. Reads the little of YAML that the files use."""
    found = []
    lines = (PROMETHEUS / name).read_text().splitlines()
    for i, line in enumerate(lines):
        if head := re.match(r"\s*- (record|alert): (\S+)$", line):
            kind, rule = head.groups()
        if body := re.match(r"(\s*)expr: (.*)$", line):
            indent, expression = body.groups()
            if expression == "|":
                rest = []
                for more in lines[i + 1:]:
                    if len(more) - len(more.lstrip()) <= len(indent):
                        break
                    rest.append(more.strip())
                expression = " ".join(rest)
            found.append((kind, rule, expression))
    return found


def panels():
    """(dashboard, panel) of each panel that is not a heading."""
    for path in sorted(DASHBOARDS.glob("*.json")):
        for panel in json.loads(path.read_text())["panels"]:
            if panel["type"] != "row":
                yield path.stem, panel


def metrics_and_roles():
    """(name, roles) of each metric of docs/metrics.md."""
    page = (ROOT / "docs/metrics.md").read_text()
    return re.findall(r"^\| `(\w+)` \| \w+ \| [^|]*\| ([^|]*) \|", page, re.M)


def as_grafana_sends(expression):
    """With the variables filled in."""
    for variable, value in (("$__rate_interval", "1m"), ("$__range", "10m"), ("$run", ".*"), ("$name", ".*"),
                            ("$sweep", ".*"), ("$courses", ".*"), ("$method", ".*")):
        expression = expression.replace(variable, value)
    return expression


def without_threshold(expression):
    """An alert's expression, which is empty while all is well, as one that always has a value: comparisons give 0 or 1, what
    picks the bad ones out of many is left out, and what silences it need only be there."""
    expression = re.sub(r" unless on \((\w+)\) (\w+) == 1", r" and on (\1) \2", expression)
    expression = re.sub(r' (==|!=|>=|<=|>|<) (?=[0-9])', r" \1 bool ", expression)
    return re.sub(r'(kernel|reason)=~"[^"]*"', "", expression)


class Prometheus:
    """A real one with the project's rules, that scrapes every second. `targets`: {job: [HOST:PORT, ...]}."""

    def __init__(self, targets):
        require("prometheus")
        self._directory = tempfile.TemporaryDirectory(prefix="slalom-prometheus-")
        directory = pathlib.Path(self._directory.name)
        for name in ("recording-rules.yml", "alert-rules.yml"):
            shutil.copy(PROMETHEUS / name, directory)
        jobs = "".join(f"  - job_name: {job}\n    static_configs: [{{targets: {json.dumps(addresses)}}}]\n"
                       for job, addresses in targets.items())
        config = (PROMETHEUS / "prometheus-local.yml").read_text()
        config = config[:config.index("scrape_configs:")] + "scrape_configs:\n" + jobs
        config = re.sub(r"_(interval|timeout): \ds", r"_\1: 1s", config)
        (directory / "prometheus.yml").write_text(config)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._address = f"127.0.0.1:{free.getsockname()[1]}"
        self._log = open(directory / "log", "w+")
        self._process = subprocess.Popen(
            ["prometheus", f"--config.file={directory}/prometheus.yml", f"--storage.tsdb.path={directory}/data",
             f"--web.listen-address={self._address}"], stdout=self._log, stderr=subprocess.STDOUT)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.terminate()
        self._process.wait()
        self._log.close()
        self._directory.cleanup()

    def log(self):
        self._log.seek(0)
        return self._log.read()

    def _get(self, path, **parameters):
        url = f"http://{self._address}{path}?{urllib.parse.urlencode(parameters)}"
        try:
            with urllib.request.urlopen(url, timeout=10) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            if error.code != 400:
                raise
            raise ValueError(json.load(error)["error"]) from None

    def values(self, expression):
        """(labels, number) of each series of it. ValueError: Prometheus does not take it."""
        result = self._get("/api/v1/query", query=expression)["data"]["result"]
        return [(series["metric"], float(series["value"][1])) for series in result]

    def has_data(self, expression):
        """Whether any series of it has a number."""
        return any(not math.isnan(number) for _, number in self.values(expression))

    def without_data(self, queries, seconds):
        """Those of `queries` ({name: expression}) that have given no number within a time."""
        missing = dict(queries)
        end = time.monotonic() + seconds
        while missing and time.monotonic() < end:
            if self._process.poll() is not None:
                raise SystemExit(f"prometheus ended:\n{self.log()}")
            try:
                missing = {name: query for name, query in missing.items() if not self.has_data(query)}
            except (OSError, KeyError):  # It has not begun to listen.
                pass
            time.sleep(0.2)
        return missing
