"""A Slurm of one node for tests: Debian's munged, slurmctld and slurmd, with a config, ports and state of their own.

Nothing of a Slurm that this machine may have is touched. Needs root, as slurmd does to start what others submit.
"""

import os
import pathlib
import shutil
import socket
import subprocess

from engine import Failure, run, say, skip, wait_for

PROGRAMS = {"munged": "munge", "slurmctld": "slurmctld", "slurmd": "slurmd", "sbatch": "slurm-client"}
CONFIG = """\
ClusterName=slalomtest
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmctldPort={controller_port}
SlurmdPort={node_port}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=batch_sched_delay=0,sched_interval=5
ReturnToService=2
MailProg=/bin/true
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory=16000 State=UNKNOWN
PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def free_ports(count):
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


class Slurm:
    """Starts with `with`, ends with it. cpus: as many as the node says it has. `environment`: in which sbatch and the others
    reach it."""

    def __init__(self, folder, cpus=2):
        os.environ["PATH"] += ":/usr/sbin"
        for program, package in PROGRAMS.items():
            if shutil.which(program) is None:
                skip(f"{program} is not installed (Debian: {package})")
        if os.geteuid() != 0:
            skip("only root can run a slurmd for tests")
        self.folder, self.cpus = pathlib.Path(folder), cpus
        self.environment = dict(os.environ, SLURM_CONF=str(self.folder / "slurm.conf"))
        self.daemons = []

    def __enter__(self):
        for name in ("state", "spool"):
            (self.folder / name).mkdir(parents=True)
        self.folder.chmod(0o755)  # Munge wants the way to its socket open to all, and its key closed.
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        controller_port, node_port = free_ports(2)
        (self.folder / "slurm.conf").write_text(CONFIG.format(
            host=socket.gethostname().split(".")[0], cpus=self.cpus, folder=self.folder, controller_port=controller_port,
            node_port=node_port))
        (self.folder / "cgroup.conf").write_text("CgroupAutomount=no\n")
        try:
            self.start("munged", "--foreground", "--force", f"--key-file={key}", f"--socket={self.folder}/munge.socket",
                       f"--pid-file={self.folder}/munged.pid", f"--log-file={self.folder}/munged.log",
                       f"--seed-file={self.folder}/munged.seed")
            wait_for("munged", lambda: (self.folder / "munge.socket").exists(), 30)
            self.start("slurmctld", "-D", "-f", self.folder / "slurm.conf")
            self.start("slurmd", "-D", "-f", self.folder / "slurm.conf")
            wait_for("a node that is idle", lambda: self("sinfo", "--noheader", "--format=%T", check=False).strip() == "idle", 60)
        except Failure as failure:
            self.__exit__()
            raise Failure(f"{failure}\n{self.logs()}") from None
        say("Slurm runs")
        return self

    def __exit__(self, *_):
        try:  # What still runs would outlive its slurmd.
            if self.states():
                self("scancel", *self.states())
                wait_for("Slurm's tasks to end", lambda: not self.states(), 60)
        except Failure as failure:
            say(failure)
        for daemon in reversed(self.daemons):
            daemon.terminate()
            try:
                daemon.wait(30)
            except subprocess.TimeoutExpired:
                daemon.kill()

    def __call__(self, *command, **options):
        return run(*command, env=self.environment, **options)

    def start(self, *command):
        output = open(self.folder / f"{command[0]}.output", "w", encoding="utf-8")
        self.daemons.append(subprocess.Popen([str(part) for part in command], env=self.environment, stdout=output, stderr=output,
                                             stdin=subprocess.DEVNULL, start_new_session=True))

    def states(self):
        """{"12_3": "RUNNING"} of all tasks in the queue."""
        return dict(line.split() for line in self("squeue", "--noheader", "--array", "--format=%F_%K %T").splitlines())

    def logs(self):
        return "\n".join(f"--- {path.name}\n" + "\n".join(path.read_text(errors="replace").splitlines()[-15:])
                         for path in sorted([*self.folder.glob("*.log"), *self.folder.glob("*.output")]))
