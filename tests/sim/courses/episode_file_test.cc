#include "sim/courses/episode_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "base/error.h"
#include "base/random.h"
#include "tests/support/scratch_directory.h"

namespace slalom::sim {
namespace {

using ::testing::HasSubstr;

TEST(EpisodeFile, GivesBackWhatWasWritten) {
  base::Random random(5);
  std::vector<EpisodeTrack> tracks;
  for (const env::Outcome outcome : {env::Outcome::kRunning, env::Outcome::kSuccess,
                                     env::Outcome::kCollision, env::Outcome::kTimeout}) {
    EpisodeTrack track{"a \"course\" \n", outcome, {}};
    for (int i = 0; i < 50; ++i) {
      track.poses.push_back({{random.Normal(), random.Normal() * 1e-9}, random.Normal()});
    }
    tracks.push_back(track);
  }
  tracks.push_back({"empty", env::Outcome::kTimeout, {}});
  tracks[1].episode = 7;
  tracks[1].interventions = {0, 3, 49};
  tracks[1].step = 0.05;
  tracks[1].motion_start = 123.456;
  tracks[2].beams = TrackBeams{{0.12, -0.01}, -2.35619, 0.1};
  for (std::size_t i = 0; i < tracks[2].poses.size(); ++i) {
    tracks[2].scans_cm.push_back({0, 65535, static_cast<std::uint16_t>(i)});
  }
  EXPECT_EQ(ParseEpisodes(PrintEpisodes(tracks), "x"), tracks);
  const test::ScratchDirectory scratch;
  WriteEpisodes(scratch.path() / "e.jsonl", tracks);
  EXPECT_EQ(ReadEpisodes(scratch.path() / "e.jsonl"), tracks);
}

TEST(EpisodeFile, OtherKeysAndBlankLinesArePassedOver) {
  const auto tracks = ParseEpisodes(
      "\n{\"seed\": 3, \"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, 3]]}\r\n\n",
      "x");
  ASSERT_EQ(tracks.size(), 1u);
  EXPECT_EQ(tracks[0], (EpisodeTrack{"c", env::Outcome::kSuccess, {{{1.0, 2.0}, 3.0}}}));
}

TEST(EpisodeFile, BadLinesAreNamed) {
  const std::string good = "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": []}\n";
  for (const std::string bad :
       {"{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, 3", "[]", "7",
        "{\"outcome\": \"success\", \"poses\": []}",
        "{\"course\": 7, \"outcome\": \"success\", \"poses\": []}",
        "{\"course\": \"c\", \"outcome\": \"won\", \"poses\": []}",
        "{\"course\": \"c\", \"poses\": []}", "{\"course\": \"c\", \"outcome\": \"success\"}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2]]}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, null]]}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [], \"step_s\": -1}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [], \"episode\": \"1\"}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, 3]], \"interventions\": "
        "[1]}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, 3]], \"interventions\": "
        "0}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, 3]], \"scans_cm\": []}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, 3]], \"scans_cm\": "
        "[[1]]}",
        "{\"course\": \"c\", \"outcome\": \"success\", \"poses\": [[1, 2, 3]], \"sensor\": [0, 0], "
        "\"angle_min_rad\": 0, \"angle_step_rad\": 0, \"scans_cm\": [[65536]]}"}) {
    try {
      ParseEpisodes(good + bad, "e.jsonl");
      FAIL() << bad;
    } catch (const base::Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("e.jsonl:2: not an episode")) << bad;
    }
  }
}

}  // namespace
}  // namespace slalom::sim
