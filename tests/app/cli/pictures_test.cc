#include <fmt/format.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <signal.h>

#include <cstdlib>
#include <thread>

#include "base/file.h"
#include "tests/app/cli/program.h"
#include "tests/metrics/http.h"
#include "tests/support/scratch_directory.h"

/// `slalom courses animate` and `slalom watch`, as a user calls them.

namespace slalom::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class PicturesTest : public ::testing::Test {
 protected:
  PicturesTest() {
    base::WriteFileAtomically(
        scratch_.path() / "tracks.jsonl",
        R"({"course": "static-1-250", "outcome": "success", "step_s": 0.2, "poses": [[-2, 3, 1.57], [-2, 3.3, 1.6], [-2.1, 3.6, 1.6]]})"
        "\n"
        R"({"course": "static-1-292", "outcome": "timeout", "poses": [[-2, 3, 1.57]]})"
        "\n");
  }

  ProgramResult Animate(const std::string& output, const std::string& course = "static-1-250",
                        const std::string& environment = "") {
    return RunShell(
        fmt::format("{} $SLALOM courses animate --courses static-test --episodes tracks.jsonl "
                    "--hold 0.2 --course {} --output {}",
                    environment, course, output),
        scratch_.path());
  }

  std::string Read(const std::string& file) { return base::ReadFile(scratch_.path() / file); }

  /// The port that `watch` says it serves at, once it does.
  int PortOf(const std::string& file) {
    std::string out;
    // What a program wrote before may still stand there.
    while (out.find("http://127.0.0.1:") == std::string::npos || !out.ends_with('\n')) {
      std::this_thread::yield();
      if (fs::exists(scratch_.path() / file)) out = Read(file);
    }
    const auto at = out.find("127.0.0.1:");
    return at == std::string::npos ? 0 : std::atoi(out.c_str() + at + 10);
  }

  const ScratchDirectory scratch_;
};

TEST_F(PicturesTest, ASvgNeedsNoOtherProgram) {
  const ProgramResult result = Animate("drive.svg", "static-1-250", "PATH=/nowhere");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(Read("drive.svg"), StartsWith("<svg "));
}

TEST_F(PicturesTest, AVideoWithoutFfmpegIsOneClearError) {
  for (const char* output : {"drive.gif", "drive.webm", "drive.mp4"}) {
    const ProgramResult result = Animate(output, "static-1-250", "PATH=/nowhere");
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_THAT(result.err, HasSubstr("apt-get install ffmpeg"));
    EXPECT_THAT(result.err, HasSubstr("*.svg"));
    EXPECT_FALSE(fs::exists(scratch_.path() / output));
  }
}

TEST_F(PicturesTest, VideosAreWhatTheirNamesSay) {
  if (std::system("command -v ffmpeg >/dev/null 2>&1") != 0) {
    GTEST_SKIP() << "no ffmpeg here: apt-get install ffmpeg";
  }
  for (const auto& [output, begin] :
       {std::pair{"d.gif", std::string("GIF89a")}, {"d.webm", std::string("\x1a\x45\xdf\xa3")}}) {
    const ProgramResult result = Animate(output);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(Read(output), StartsWith(begin));
  }
  ASSERT_EQ(Animate("d.mp4").exit_code, 0);
  EXPECT_EQ(Read("d.mp4").substr(4, 4), "ftyp");
  // 0.4 s of driving and 0.2 s of hold at 20 pictures a second.
  const ProgramResult frames = RunShell(
      "ffmpeg -hide_banner -i d.gif -f framemd5 - 2>/dev/null | grep -vc '#'", scratch_.path());
  EXPECT_EQ(frames.out, "12\n");
}

TEST_F(PicturesTest, WhatCannotBeShownIsRefused) {
  const auto error = [&](const std::string& output, const std::string& course) {
    const ProgramResult result = Animate(output, course);
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_FALSE(fs::exists(scratch_.path() / output));
    return result.err;
  };
  EXPECT_THAT(error("a.svg", "static-1-292"), HasSubstr("has no step_s"));
  EXPECT_THAT(error("a.svg", "static-1-097"), HasSubstr("holds no episode"));
  EXPECT_THAT(error("a.svg", "nowhere"), HasSubstr("holds no course named nowhere"));
  EXPECT_THAT(error("a.avi", "static-1-250"), HasSubstr("format is not clear"));
}

// ---- slalom watch

TEST_F(PicturesTest, WatchRefusesWhatIsNoRun) {
  base::MakeDirectories(scratch_.path() / "runs/mine");
  base::WriteFileAtomically(scratch_.path() / "runs/mine/metrics.csv", "steps\n");
  base::MakeDirectories(scratch_.path() / "empty");
  const auto error = [&](const std::string& run) {
    const ProgramResult result = RunProgram({"watch", run}, scratch_.path());
    EXPECT_EQ(result.exit_code, 1);
    return result.err;
  };
  EXPECT_THAT(error("elsewhere"), HasSubstr("elsewhere: there is no such directory"));
  EXPECT_THAT(error("mine"), HasSubstr("did you mean runs/mine?"));
  EXPECT_THAT(error("empty"), HasSubstr("empty: holds no run"));
  EXPECT_THAT(error("tracks.jsonl"), HasSubstr("is not a directory"));
}

TEST_F(PicturesTest, WatchServesThePageUntilItIsStopped) {
  base::MakeDirectories(scratch_.path() / "runs/mine");
  base::WriteFileAtomically(scratch_.path() / "runs/mine/metrics.csv",
                            "training_s,steps\n1,100\n2,2");
  base::WriteFileAtomically(scratch_.path() / "runs/mine/config.toml", "[run]\nmax_steps = 400\n");
  BackgroundProgram program({"watch", "runs/mine", "--port", "0"}, scratch_.path());
  const int port = PortOf("out");
  ASSERT_GT(port, 0);
  EXPECT_THAT(Exchange(port, "GET / HTTP/1.1\r\n\r\n"), HasSubstr("<title>Slalom run</title>"));
  const std::string run = Exchange(port, "GET /run/mine.json HTTP/1.1\r\n\r\n");
  EXPECT_THAT(run, HasSubstr("\"steps\":100"));
  EXPECT_THAT(run, HasSubstr("\"left_s\":3"));
  EXPECT_THAT(Exchange(port, "POST / HTTP/1.1\r\n\r\n"), StartsWith("HTTP/1.1 405 "));

  const ProgramResult busy =
      RunProgram({"watch", "runs/mine", "--port", std::to_string(port)}, scratch_.path());
  EXPECT_EQ(busy.exit_code, 1);
  EXPECT_THAT(busy.err, HasSubstr("Address already in use"));
  program.Signal(SIGINT);
  EXPECT_EQ(program.Wait(), 0);
}

TEST_F(PicturesTest, WatchDrivesTheNewestPolicy) {
  WriteTinyConfig(scratch_.path(), 1000);
  ASSERT_EQ(RunProgram({"train", "tiny.toml", "--name", "tiny", "--no-evaluation"}, scratch_.path())
                .exit_code,
            0);
  BackgroundProgram program({"watch", "runs/tiny", "--port", "0"}, scratch_.path());
  const int port = PortOf("out");
  std::string run;
  while (run.find("\"number\":1") == std::string::npos) {
    // Leaves the processor to the thread that drives: at nice 19 it gets next to nothing beside a
    // loop that never waits.
    ::poll(nullptr, 0, 20);
    run = Exchange(port, "GET /run/tiny.json HTTP/1.1\r\n\r\n");
    ASSERT_THAT(run, StartsWith("HTTP/1.1 200 OK"));
    ASSERT_THAT(run, Not(HasSubstr("cannot be driven")));
  }
  EXPECT_THAT(run, HasSubstr("The policy after"));
  EXPECT_THAT(run, HasSubstr("\"state\":\"finished\""));
  const std::string picture = Exchange(port, "GET /run/tiny.svg?1 HTTP/1.1\r\n\r\n");
  EXPECT_THAT(picture, StartsWith("HTTP/1.1 200 OK"));
  EXPECT_THAT(picture, HasSubstr("Content-Type: image/svg+xml"));
  EXPECT_THAT(picture, HasSubstr("class=\"robot\""));
  program.Signal(SIGTERM);
  EXPECT_EQ(program.Wait(), 0);
}

}  // namespace
}  // namespace slalom::test
