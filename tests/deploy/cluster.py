"""A running service of containers, by compose or as a Swarm stack, as the tests see it: by label, metrics and process."""

import os
import pathlib
import signal

from engine import BASE, Failure, metrics_of, prometheus_query, run, say, wait_for

ROLES = ("replay", "learner", "actor", "evaluator")
SERVICES = ROLES + ("prometheus",)

# Bash's own connection, as the image's health check uses it: no port is published, and nothing else is in the image.
READ_METRICS = "exec 3<>/dev/tcp/127.0.0.1/9400; printf 'GET /metrics HTTP/1.0\\r\\n\\r\\n' >&3; cat <&3"


class Cluster:
    """`labels`: what the containers of a service bear, with {} for the service's name."""

    def __init__(self, engine, *labels):
        self.engine = engine
        self.labels = labels

    def containers(self, service, *options):
        """Identifiers of the running ones, the oldest first; with option --all also of those that ended."""
        filters = [word for label in self.labels for word in ("--filter", "label=" + label.format(service))]
        return list(reversed(self.engine("ps", "--quiet", *options, *filters).split()))

    def metrics(self, container):
        """What the container shows; nothing while it cannot answer."""
        answer = self.engine("exec", container, "bash", "-c", READ_METRICS, check=False).replace("\r", "")
        return metrics_of(answer.partition("\n\n")[2])

    def value(self, service, name, **labels):
        """The sum of a metric over the service's containers and all labels that are not given."""
        return sum(number for container in self.containers(service)
                   for found, with_labels, number in self.metrics(container)
                   if found == name and labels.items() <= with_labels.items())

    def queried(self, query):
        """The numbers that Prometheus answers."""
        containers = self.containers("prometheus")
        return [number for _, number in prometheus_query(self.engine, containers[0], query)] if containers else []

    def healthy(self, service):
        """How many containers of the service are well."""
        return sum(self.engine("inspect", "--format", "{{.State.Health.Status}}", container, check=False).strip() == "healthy"
                   for container in self.containers(service))

    def wait_healthy(self, service, number=1, limit_s=120):
        try:
            wait_for(f"{number} x {service} healthy", lambda: self.healthy(service) == number, limit_s)
        except Failure as failure:
            raise Failure(f"{failure}\n{self.logs(service)}") from None

    def logs(self, service, lines=20):
        """What the containers of the service, ended ones too, said last."""
        return "\n".join(f"--- {service} {container}\n" + run("sh", "-c", f"{self.engine.docker} logs --tail {lines} {container} 2>&1")
                         for container in self.containers(service, "--all"))

    def ledgers(self, volume):
        """Every actor's account in the volume that they share: {name: {"made": ..., "accepted": ..., "lost": ..., "pending": ...}}."""
        script = 'for ledger in /state/*/actors/*/ledger; do echo "$ledger $(od -An -v -t d8 -w1000 "$ledger")"; done'
        lines = self.engine("run", "--rm", "--volume", f"{volume}:/state:ro", BASE, "sh", "-c", script).splitlines()
        accounts = {}
        for line in lines:
            path, _, which, *numbers = line.split()  # The magic; which of two copies counts; the copies.
            size = len(numbers) // 2
            entries = [int(number) for number in numbers[(int(which) & 1) * size:][:size]]
            _, made, accepted, earlier_made, earlier_accepted, *lost = entries
            accounts[path.split("/")[-2]] = {"made": made + earlier_made, "accepted": accepted + earlier_accepted,
                                             "lost": sum(lost), "pending": made - accepted}
        return accounts

    def crash(self, service):
        """Ends a container's process as a crash would: Docker itself has not asked for it, and so starts it again."""
        container = self.containers(service)[0]
        pid = int(self.engine.inspect(container, "{{.State.Pid}}"))
        if pathlib.Path(f"/proc/{pid}/root").exists():
            os.kill(pid, signal.SIGKILL)
        else:  # The engine is another machine's, or we are not root.
            raise Failure(f"the process {pid} of {service} cannot be reached from here")
        say(f"killed {service}")
        return container

    def wait_for_steps(self, more, limit_s=180):
        """Until the table has accepted so many steps more than now."""
        name = "slalom_steps_accepted_total"
        wait_for("the replay server's metrics", lambda: self.metrics_present("replay", name), limit_s)
        target = self.value("replay", name) + more
        wait_for(f"{more} more steps in the table", lambda: self.value("replay", name) >= target, limit_s)

    def metrics_present(self, service, name):
        return any(found == name for container in self.containers(service) for found, _, _ in self.metrics(container))
