#include "learner/service/actor_figures.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

namespace slalom::learner {
namespace {

proto::RoleStatus Actor(const std::string& name, double episodes, double collision_rate = 0.5) {
  proto::RoleStatus role;
  role.report.role = "actor";
  role.report.name = name;
  role.report.figures = {{"episodes", episodes},
                         {"success_rate", 0.25},
                         {"collision_rate", collision_rate},
                         {"mean_cost", 10.0 * collision_rate}};
  role.connected = true;
  return role;
}

TEST(Summarise, AveragesConnectedActorsThatFinishedAnEpisode) {
  proto::RoleStatus silent = Actor("silent", 1000, 1.0), fresh = Actor("fresh", 0);
  silent.connected = false;
  fresh.report.figures.erase("success_rate");
  proto::RoleStatus evaluator = Actor("evaluator", 7, 1.0);
  evaluator.report.role = "evaluator";
  const ActorFigures sum =
      Summarise({.roles = {Actor("a", 10, 0.2), Actor("b", 30, 0.4), silent, fresh, evaluator}});
  EXPECT_EQ(sum.num_episodes, 40);
  EXPECT_DOUBLE_EQ(sum.collision_rate, 0.3);
  EXPECT_DOUBLE_EQ(sum.mean_cost, 3.0);
  EXPECT_TRUE(std::isnan(Summarise({}).collision_rate));
  proto::RoleStatus earlier = Actor("a", 10);
  earlier.report.figures.erase("mean_cost");
  EXPECT_TRUE(std::isnan(Summarise({.roles = {earlier}}).mean_cost)) << "not 0: it is not known";
}

// A learner that starts again, an actor that was not heard of for a while, a replay server that
// knows nobody yet: none of them makes old episodes new.
TEST(FinishedEpisodes, CountsEachOnceOverSilencesAndRestarts) {
  FinishedEpisodes episodes;
  EXPECT_EQ(episodes.Take({}), 0);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", 50000), Actor("b", 40000)}}), 0);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", 50010), Actor("b", 40000)}}), 10);
  EXPECT_EQ(episodes.Take({}), 0);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", 50030)}}), 20);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", 50030), Actor("b", 40007)}}), 7);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", 3), Actor("b", 40007), Actor("c", 9)}}), 3);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", 3), Actor("b", 40007), Actor("c", 10)}}), 1);
}

TEST(FinishedEpisodes, WhatNoCountCanBeIsNone) {
  FinishedEpisodes episodes;
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", 5)}}), 0);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", std::nan(""))}}), 0);
  EXPECT_EQ(episodes.Take({.roles = {Actor("a", -3)}}), 0);
  EXPECT_GT(episodes.Take({.roles = {Actor("a", std::numeric_limits<double>::infinity())}}), 0);
}

}  // namespace
}  // namespace slalom::learner
