#!/usr/bin/env python3
"""Writes dashboards/*.json, which Grafana reads. Change panels here, run this, and keep both.

With a directory as its argument, writes there instead."""

import json
import pathlib
import sys

import panels
from panels import (ACTOR, BYTES, COUNT, PER_SECOND, RATIO, RUN, SECONDS, bar_chart, bars, dashboard,
                    graph, number, quantiles, row)

R = 'run=~"$run"'
A = 'run=~"$run", name=~"$name"'
RATE = "[$__rate_interval]"
PROCESS = "{{run}} {{role}} {{name}}"


def rate(metric, labels="", by="run", where=R):
    """Sum of the rates of a counter."""
    return f"sum by ({by}) (rate({metric}{{{where}{labels}}}{RATE}))"


def largest(metric, by="run", where=R):
    return f"max by ({by}) ({metric}{{{where}}})"


OVERVIEW = dashboard("overview", "overview", "Is the service well, and does it learn?", [
    number("Processes up", COUNT, "Roles that answer Prometheus.", "sum(up)"),
    number("Alerts firing", COUNT, "docs/operations.md says what each means.",
           'count(ALERTS{alertstate="firing"}) or vector(0)', bad_above=1),
    number("Environment steps", PER_SECOND, "Of all actors.",
           f"sum(run:slalom_environment_steps:rate1m{{{R}}})"),
    number("Updates", PER_SECOND, "Of the learner.", f"sum(run:slalom_updates:rate1m{{{R}}})"),
    number("Success, evaluated", RATIO, "Of the newest policy scored, without exploration.",
           largest("slalom_evaluation_success_rate"), "{{run}}"),
    number("Steps lost", COUNT, "Steps that never reached the table, ever.",
           f"sum(slalom_steps_lost_total{{{R}}})", bad_above=1),
    row("Rates"),
    graph("Environment steps", PER_SECOND, "Of all actors.",
          (f"run:slalom_environment_steps:rate1m{{{R}}}", "{{run}}")),
    graph("Updates", PER_SECOND, "Of the learner.",
          (f"run:slalom_updates:rate1m{{{R}}}", "{{run}}")),
    graph("Success rate", RATIO, "Evaluated: newest policy scored. Training: with exploration.",
          (largest("slalom_evaluation_success_rate", "run, course_set"), "{{run}} {{course_set}}"),
          (f"run:slalom_episodes_success:ratio_rate5m{{{R}}}", "{{run}} training"), maximum=1),
    row("Data on its way"),
    graph("Waiting at queues", RATIO, "Part of the time that work waited at each queue.",
          (f"sum by (run, role, queue) (run_name_queue:slalom_blocked:ratio_rate1m{{{R}}})",
           "{{run}} {{role}} {{queue}}")),
    graph("Policy lag", COUNT, "Versions between the learner and the data it learns from.",
          (largest("slalom_policy_lag_versions"), "{{run}}")),
    graph("Publish to acting", SECONDS, "From a policy's publication until the actors have it.",
          *quantiles("slalom_publish_to_acting_seconds", ["run"])),
    graph("Peers", COUNT, "Connected to the replay server.",
          (f'sum by (run, peer_role) (slalom_connected_peers{{{R}, role="replay"}})',
           "{{run}} {{peer_role}}")),
    graph("Restarts", COUNT, "Starts on the same state, the first not counted.",
          (largest("slalom_restarts_total", "run, role, name"), PROCESS)),
    graph("Refused", PER_SECOND, "Messages refused, by reason.",
          (rate("slalom_messages_refused_total", by="run, role, reason"),
           "{{run}} {{role}} {{reason}}")),
    row("Processes"),
    graph("Memory", BYTES, "Resident.",
          (f"process_resident_memory_bytes{{{R}}}", PROCESS)),
    graph("Processor", COUNT, "Cores in use.",
          (rate("process_cpu_seconds_total", by="run, role, name"), PROCESS)),
    graph("File descriptors", COUNT, "Open.", (f"process_open_fds{{{R}}}", PROCESS)),
    bars("Builds", COUNT, "Processes of each version and commit.",
         f"count by (run, version, commit) (slalom_build_info{{{R}}})",
         "{{run}} {{version}} {{commit}}"),
    bars("BLAS kernels", COUNT, "Processes that multiply with each kernel; none: without.",
         f"count by (run, role, kernel) (slalom_blas_info{{{R}}})", "{{run}} {{role}} {{kernel}}"),
])

LEARNING = dashboard("learning", "learning", "What is learned, and how well the learner does.", [
    row("Evaluation"),
    graph("Outcomes", RATIO, "Of the newest policy scored.",
          (largest("slalom_evaluation_success_rate", "run, course_set"),
           "{{run}} {{course_set}} success"),
          (largest("slalom_evaluation_collision_rate", "run, course_set"),
           "{{run}} {{course_set}} collision"),
          (largest("slalom_evaluation_timeout_rate", "run, course_set"),
           "{{run}} {{course_set}} timeout"), maximum=1),
    graph("Score", COUNT, "Mean BARN score, 0 to 0.5.",
          (largest("slalom_evaluation_score", "run, course_set"), "{{run}} {{course_set}}"),
          maximum=0.5),
    graph("Time to the goal", SECONDS, "Mean of successful episodes.",
          (largest("slalom_evaluation_time_seconds", "run, course_set"), "{{run}} {{course_set}}")),
    row("Training episodes"),
    graph("Success rate", RATIO, "Mean over the actors, exploration included.",
          (f"avg by (run) (slalom_success_rate{{{R}}})", "{{run}}"), maximum=1),
    graph("Return", COUNT, "Mean over the actors.",
          (f"avg by (run) (slalom_episode_return{{{R}}})", "{{run}}"), minimum=None),
    graph("Length", COUNT, "Mean steps of an episode.",
          (f"avg by (run) (slalom_episode_steps{{{R}}})", "{{run}}")),
    row("Updates"),
    graph("Critic loss", COUNT, "Mean squared error of one critic.",
          (largest("slalom_critic_loss"), "{{run}}")),
    graph("Values", COUNT, "Of what was done, and of what the actor would do.",
          (largest("slalom_q_mean"), "{{run}} done"),
          (largest("slalom_actor_q_mean"), "{{run}} actor"), minimum=None),
    graph("Gradient norms", COUNT, "Of critics and actor.",
          (largest("slalom_critic_gradient_norm"), "{{run}} critics"),
          (largest("slalom_actor_gradient_norm"), "{{run}} actor")),
    graph("Entropy", COUNT, "Of a stochastic policy, nats, and its weight.",
          (largest("slalom_policy_entropy_nats"), "{{run}} entropy"),
          (largest("slalom_temperature"), "{{run}} temperature"), minimum=None),
    graph("Constraint", COUNT, "Collisions per episode above the limit, their weight, their mean value.",
          (largest("slalom_constraint_violation"), "{{run}} violation"),
          (largest("slalom_constraint_multiplier"), "{{run}} multiplier"),
          (largest("slalom_cost_q_mean"), "{{run}} cost"), minimum=None),
    graph("Transition model", COUNT, "Error of a number of the next frame, and were nothing to change.",
          (largest("slalom_model_error"), "{{run}} model"),
          (largest("slalom_model_steps_error"), "{{run}} model, five steps ahead"),
          (largest("slalom_model_change"), "{{run}} no change")),
    graph("Calibration of the model", RATIO, "Numbers inside what should hold half and nine tenths of them.",
          (largest("slalom_model_inside_50"), "{{run}} half"),
          (largest("slalom_model_inside_90"), "{{run}} nine tenths"), maximum=1),
    graph("Imagined transitions", COUNT, "What the model imagined for the policy to learn from, so far.",
          (largest("slalom_imagined_transitions"), "{{run}}")),
    graph("Updates", PER_SECOND, "Of the critics.",
          (f"run:slalom_updates:rate1m{{{R}}}", "{{run}}")),
    graph("Time of an update", SECONDS, "Without the wait for its batch.",
          *quantiles("slalom_update_seconds", ["run"])),
    graph("Waiting for batches", RATIO, "Part of the time that the learner had none.",
          (f'run_name_queue:slalom_blocked:ratio_rate1m{{{R}, queue="batches"}}', "{{run}}"),
          maximum=1),
    row("Policies"),
    graph("Versions", COUNT, "Published, and scored last.",
          (f'max by (run) (slalom_policy_version{{{R}, role="learner"}})', "{{run}} published"),
          (largest("slalom_evaluation_policy_version"), "{{run}} scored")),
    graph("Published", PER_SECOND, "Policies a second.",
          (rate("slalom_policies_published_total"), "{{run}}")),
    graph("Lag", COUNT, "Versions behind: of the data learned from, and of the slowest reader.",
          (largest("slalom_policy_lag_versions"), "{{run}} data"),
          (largest("slalom_reader_lag_versions"), "{{run}} slowest reader")),
    row("Checkpoints"),
    graph("Age", SECONDS, "Of the newest.",
          (f"run:slalom_checkpoint_age:seconds{{{R}}}", "{{run}}")),
    graph("Time to write", SECONDS, "Of the last.",
          (largest("slalom_checkpoint_seconds"), "{{run}}")),
    graph("Size", BYTES, "Of the last.", (largest("slalom_checkpoint_bytes"), "{{run}}")),
])

REPLAY = dashboard("replay", "replay", "The replay server: table, limiter, journal, peers.", [
    row("Table and limiter"),
    graph("Rows", COUNT, "In the table, and what it can hold.",
          (largest("slalom_table_rows"), "{{run}}"),
          (largest("slalom_table_capacity_rows"), "{{run}} capacity")),
    graph("Samples per insert", COUNT, "Transitions sampled for each step, and the target.",
          (largest("slalom_samples_per_insert"), "{{run}}"),
          (largest("slalom_samples_per_insert_target"), "{{run}} target")),
    graph("Steps and samples", PER_SECOND, "Into the table and out of it.",
          (rate("slalom_steps_accepted_total"), "{{run}} steps in"),
          (rate("slalom_samples_total"), "{{run}} transitions out")),
    row("Queues"),
    graph("Depth", COUNT, "Held by the limiter (inserts, samples), not yet written (journal).",
          (f'max by (run, queue) (slalom_queue_depth{{{R}, role="replay"}})', "{{run}} {{queue}}")),
    graph("Bytes", BYTES, "In each queue.",
          (f'max by (run, queue) (slalom_queue_bytes{{{R}, role="replay"}})', "{{run}} {{queue}}")),
    graph("Waiting", RATIO, "Part of the time that work waited.",
          (f'run_name_queue:slalom_blocked:ratio_rate1m{{{R}, role="replay"}}',
           "{{run}} {{queue}}")),
    graph("Time of an insert", SECONDS, "From arrival to acknowledgement.",
          *quantiles("slalom_insert_seconds", ["run"])),
    graph("Time of a sample", SECONDS, "To draw and gather one batch.",
          *quantiles("slalom_sample_seconds", ["run"])),
    graph("Chunks", PER_SECOND, "Accepted, seen before, refused.",
          (rate("slalom_chunks_accepted_total"), "{{run}} accepted"),
          (rate("slalom_chunks_duplicate_total"), "{{run}} duplicate"),
          (rate("slalom_chunks_rejected_total", ', role="replay"', "run, reason"),
           "{{run}} {{reason}}")),
    row("Journal"),
    graph("On disk", BYTES, "All segments.", (largest("slalom_journal_bytes"), "{{run}}")),
    graph("Written", "Bps", "Into the journal.",
          (rate("slalom_journal_written_bytes_total"), "{{run}}")),
    graph("Time of a sync", SECONDS, "fdatasync, in a thread of its own.",
          *quantiles("slalom_journal_sync_seconds", ["run"])),
    graph("Segments", COUNT, "Files.", (largest("slalom_journal_segments"), "{{run}}")),
    graph("Age of the last sync", SECONDS, "What a loss of power would cost.",
          (f"run:slalom_journal_sync_age:seconds{{{R}}}", "{{run}}")),
    graph("Errors", COUNT, "Failing now (1), and failures so far.",
          (largest("slalom_journal_failing"), "{{run}} failing"),
          (largest("slalom_journal_errors_total"), "{{run}} errors")),
    row("Peers"),
    graph("Sessions", COUNT, "Of actors.", (largest("slalom_sessions"), "{{run}}")),
    graph("Lost", COUNT, "Gone without a goodbye so far, by role.",
          (f"sum by (run, peer_role) (slalom_peers_lost_total{{{R}}})", "{{run}} {{peer_role}}")),
    graph("Messages", PER_SECOND, "Received, by kind.",
          (rate("slalom_messages_total", ', role="replay"', "run, message"), "{{run}} {{message}}")),
    graph("Connections", COUNT, "Open, and how many may be.",
          (largest("slalom_server_connections", "run, role"), "{{run}} {{role}}"),
          (largest("slalom_server_connections_limit", "run, role"), "{{run}} {{role}} limit")),
    graph("Turned away", PER_SECOND, "Handshakes that failed, connections beyond a bound, malformed messages, refusals.",
          (rate("slalom_rejected_connections_total", ', role="replay"'), "{{run}} handshakes"),
          (rate("slalom_connections_ended_total", ', role="replay"', "run, reason"), "{{run}} ended ({{reason}})"),
          (rate("slalom_messages_malformed_total", ', role="replay"'), "{{run}} malformed"),
          (rate("slalom_messages_refused_total", ', role="replay"'), "{{run}} refused")),
])

def of_each(expression, worst, legend="{{run}} {{name}}"):
    """An expression of each actor: its median, and the ten worst of each run, as there may be a thousand. `worst`: topk or bottomk."""
    return ((f"quantile by (run) (0.5, {expression})", "{{run}} median"), (f"{worst} by (run) (10, {expression})", legend))


ACTORS = dashboard("actors", "actors", "Actors: what they drive, send and wait for.", [
    row("Driving"),
    graph("Environment steps", PER_SECOND, "Median of the actors, and the ten slowest.",
          *of_each(rate("slalom_environment_steps_total", by="run, name", where=A), "bottomk")),
    graph("Episodes", PER_SECOND, "That ended, by outcome.",
          (rate("slalom_episodes_total", by="run, outcome", where=A), "{{run}} {{outcome}}")),
    graph("Success rate", RATIO, "Of the last episodes, exploration included: median, and the ten lowest.",
          *of_each(f"slalom_success_rate{{{A}}}", "bottomk"), maximum=1),
    row("Sending"),
    graph("Chunks", PER_SECOND, "Sent first, sent again, acknowledged.",
          (rate("slalom_chunks_sent_total", where=A), "{{run}} sent"),
          (rate("slalom_chunks_resent_total", where=A), "{{run}} resent"),
          (rate("slalom_chunks_acknowledged_total", where=A), "{{run}} acknowledged")),
    graph("Time of an insert", SECONDS, "At the replay server, from arrival to acknowledgement.",
          *quantiles("slalom_insert_seconds", ["run"])),
    graph("Unacknowledged", BYTES, "Kept to be sent again: median, the ten with most, and how much may be.",
          *of_each(f'slalom_queue_bytes{{{A}, queue="unacknowledged"}}', "topk"),
          (f'max by (run) (slalom_queue_limit_bytes{{{A}, queue="unacknowledged"}})',
           "{{run}} limit")),
    graph("Steps pending", COUNT, "Made and not yet acknowledged: median, and the ten with most.",
          *of_each(f"slalom_steps_pending{{{A}}}", "topk")),
    graph("Waiting", RATIO, "Part of the time that an actor had no room: median, and the ten that wait most.",
          *of_each(f'run_name_queue:slalom_blocked:ratio_rate1m{{{A}, role="actor"}}', "topk"), maximum=1),
    graph("Steps lost", COUNT, "So far, by reason.",
          (f"sum by (run, reason) (slalom_steps_lost_total{{{A}}})", "{{run}} {{reason}}")),
    row("Policies"),
    graph("Version", COUNT, "That the actors drive with: median, and the ten oldest.",
          *of_each(f'slalom_policy_version{{{A}, role="actor"}}', "bottomk")),
    graph("Age", SECONDS, "Of that policy: median, and the ten oldest.",
          *of_each(f'run_role_name:slalom_policy_age:seconds{{{A}, role="actor"}}', "topk")),
    graph("Publish to acting", SECONDS, "From a policy's publication until an actor has it.",
          *quantiles("slalom_publish_to_acting_seconds", ["run"])),
    row("Processes"),
    graph("Memory", BYTES, "Resident: median, and the ten largest.",
          *of_each(f'process_resident_memory_bytes{{{A}, role="actor"}}', "topk")),
    graph("Processor", COUNT, "Cores in use: median, and the ten that use most.",
          *of_each(rate("process_cpu_seconds_total", ', role="actor"', "run, name", A), "topk")),
    graph("Connections", COUNT, "Made so far to each server; more than one: it broke. Median, and the ten with most.",
          *of_each(f'slalom_connections_total{{{A}, role="actor"}}', "topk", "{{run}} {{name}} {{server}}")),
], (RUN, ACTOR))

# Of a sweep. Several workers may show the same cells, so a cell's figure is the largest of theirs before anything else is done
# with it. Scores of snapshots are not shown.
C = 'sweep=~"$sweep", method=~"$method"'
S = f'{C}, courses=~"$courses", snapshot_steps="0"'
CELL = "sweep, cell, row, method, training_courses, seed"


def cells(metric, labels=CELL, where=C):
    """The figure of each cell, from whichever worker shows it."""
    return f"max by ({labels}) ({metric}{{{where}}})"


SUCCESS = cells("slalom_sweep_success_rate", f"{CELL}, courses", S)
COLLISION = cells("slalom_sweep_collision_rate", f"{CELL}, courses", S)
TRAINING = cells("slalom_sweep_training_success_rate")
# Planners have no training courses.
TRAINED_SUCCESS = cells("slalom_sweep_success_rate", f"{CELL}, courses", f'{S}, training_courses!="0"')

SWEEP = dashboard("sweep", "sweep", "The cells of a sweep while they are trained and scored.", [
    bar_chart("Success against the number of training courses", RATIO,
              "Mean over seeds. In training episodes: with exploration, before any score is there.",
              f"avg by (training_courses, courses) ({TRAINED_SUCCESS}) or label_replace(avg by (training_courses) "
              f'({TRAINING}), "courses", "training episodes", "", "")', "training_courses", "courses"),
    bars("Cells", COUNT, "In each state.", 'max by (sweep, state) (slalom_sweep_cells{sweep=~"$sweep"})',
         "{{sweep}} {{state}}", width=8),
    row("Progress"),
    number("Done", RATIO, "Cells that are trained and scored.",
           'sum(max by (sweep) (slalom_sweep_cells{sweep=~"$sweep", state="done"})) / '
           'sum(max by (sweep, state) (slalom_sweep_cells{sweep=~"$sweep"}))'),
    number("Scores", RATIO, "Of those that the plan asks for.",
           'sum(max by (sweep) (slalom_sweep_scores_done{sweep=~"$sweep"})) / '
           'sum(max by (sweep) (slalom_sweep_scores{sweep=~"$sweep"}))'),
    number("Running", COUNT, "Cells in training or being scored.",
           'sum(max by (sweep, state) (slalom_sweep_cells{sweep=~"$sweep", state=~"training|scoring"}))'),
    number("Failed", COUNT, "Cells whose last attempt failed; `slalom sweep status` says why.",
           f"sum({cells('slalom_sweep_failed')})", bad_above=1),
    number("Environment steps", PER_SECOND, "Of all cells.",
           'sum(sweep:slalom_sweep_steps:rate1m{sweep=~"$sweep"})'),
    number("Training time", SECONDS, "Of all cells.", f"sum({cells('slalom_sweep_training_seconds')})"),
    row("Success"),
    graph("Success rate by method", RATIO, "Mean over the scores that are there.",
          (f"avg by (sweep, method, courses) ({SUCCESS})", "{{sweep}} {{method}} {{courses}}"), maximum=1, width=12),
    graph("Success rate of training episodes by method", RATIO, "Mean over cells, exploration included.",
          (f"avg by (sweep, method) ({TRAINING})", "{{sweep}} {{method}}"), maximum=1, width=12),
    bars("Success rate by row", RATIO, "Mean over seeds.", f"avg by (sweep, row, courses) ({SUCCESS})",
         "{{sweep}} {{row}}: {{courses}}"),
    bars("Spread over seeds", RATIO, "Success rate of the best seed less that of the worst.",
         f"max by (sweep, row, courses) ({SUCCESS}) - min by (sweep, row, courses) ({SUCCESS})",
         "{{sweep}} {{row}}: {{courses}}"),
    graph("Collision rate by method", RATIO, "Mean over the scores that are there.",
          (f"avg by (sweep, method, courses) ({COLLISION})", "{{sweep}} {{method}} {{courses}}"), maximum=1, width=12),
    graph("Success rate of training episodes", RATIO, "Of each cell, exploration included.",
          (TRAINING, "{{row}}, seed {{seed}}"), maximum=1, width=12),
    row("Work"),
    graph("Environment steps", PER_SECOND, "Of all cells.",
          ('sweep:slalom_sweep_steps:rate1m{sweep=~"$sweep"}', "{{sweep}}")),
    graph("Steps of each cell", COUNT, "So far.", (cells("slalom_sweep_steps"), "{{row}}, seed {{seed}}")),
    graph("Updates", COUNT, "So far, of all cells.",
          (f"sum by (sweep) ({cells('slalom_sweep_updates')})", "{{sweep}}")),
    graph("States", COUNT, "Cells in each state.",
          ('max by (sweep, state) (slalom_sweep_cells{sweep=~"$sweep"})', "{{sweep}} {{state}}"), width=12),
    graph("Failures", COUNT, "Cells whose last attempt failed.",
          (f"sum by (sweep, method) ({cells('slalom_sweep_failed')})", "{{sweep}} {{method}}"), width=12),
], (panels.SWEEP, panels.COURSES, panels.METHOD))

if __name__ == "__main__":
    directory = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else
                             pathlib.Path(__file__).parent / "dashboards")
    for board in (OVERVIEW, LEARNING, REPLAY, ACTORS, SWEEP):
        name = board["uid"].removeprefix("slalom-")
        (directory / f"{name}.json").write_text(json.dumps(board, indent=1) + "\n")
