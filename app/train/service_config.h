#pragma once

#include <string>
#include <vector>

#include "base/config_field.h"

namespace slalom::train {

/// Addresses of the distributed service's processes, and the directories of their state.
struct ServiceConfig {
  std::string name;
  std::vector<std::string> replay = {"tcp://127.0.0.1:5550"};
  std::string replay_bind;
  std::string learner = "tcp://127.0.0.1:5551";
  std::string learner_bind;
  std::string metrics = "127.0.0.1:0";
  std::string health;
  std::string state = "state";
  int io_threads = 1;
  int max_connections = 4096;

  template <class Visitor>
  void Visit(Visitor& v) {
    v("name", name,
      "Name of this process among those of its role, the same after a restart. Empty: the "
      "machine's name for an actor or evaluator, else the role.");
    v("replay", replay,
      "Where the replay server is reached. A list: where each of several is, which share rows and "
      "work. An actor, and a server itself, has the place in the list, counted from 0, with which "
      "its name ends.");
    v("replay_bind", replay_bind,
      "Where the replay server listens, such as tcp://*:5550. Empty: at its place in "
      "service.replay.");
    v("learner", learner, "Where the learner's policies are fetched.");
    v("learner_bind", learner_bind, "Where the learner listens. Empty: at service.learner.");
    v("metrics", metrics,
      "Address at which this process shows /metrics to Prometheus and answers /healthy; port 0: "
      "any free one. Empty: none.");
    v("health", health,
      "A second address for the same, such as 127.0.0.1:9401, which only health checks on this "
      "machine reach: whoever fills the first one with connections does not keep them out. Empty: "
      "none.");
    v("state", state,
      "Directory below which each process keeps its state: replay/, learner/, actors/NAME/, "
      "evaluators/NAME/.");
    v("io_threads", io_threads, base::Range{1, 16}, "",
      "Threads that copy between sockets and the network, and encrypt.");
    v("max_connections", max_connections, base::Range{1, 65536}, "",
      "Connections that the replay server and the learner have at most, each, and fewer if they "
      "may open too few files and connections. The next one is told so and ends. Connections that "
      "have sent nothing yet have places of their own, and so have eight with an operator's key.");
  }
};

}  // namespace slalom::train
