#include "base/progress.h"

#include <gtest/gtest.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <string>

namespace slalom::base {
namespace {

/// A log file: what was written to it.
class LogFile {
 public:
  ~LogFile() { std::fclose(file_); }
  std::FILE* file() { return file_; }
  std::string text() {
    std::rewind(file_);
    std::string text;
    for (int c = std::fgetc(file_); c != EOF; c = std::fgetc(file_)) text += static_cast<char>(c);
    return text;
  }

 private:
  std::FILE* file_ = std::tmpfile();
};

/// A terminal that hands on what it gets unchanged.
class Terminal {
 public:
  explicit Terminal(int columns) {
    int slave = -1;
    EXPECT_EQ(openpty(&master_, &slave, nullptr, nullptr, nullptr), 0);
    termios mode{};
    tcgetattr(slave, &mode);
    cfmakeraw(&mode);
    tcsetattr(slave, TCSANOW, &mode);
    out_ = fdopen(slave, "w");
    Resize(columns);
  }
  ~Terminal() {
    std::fclose(out_);
    Close();
  }
  void Resize(int columns) const {
    winsize size{};
    size.ws_col = static_cast<unsigned short>(columns);
    size.ws_row = 24;
    ioctl(master_, TIOCSWINSZ, &size);
  }
  /// Whether this is what has come since the last call. Waits for as many characters.
  testing::AssertionResult Shows(const std::string& text) const {
    std::string shown;
    std::array<char, 4096> buffer{};
    while (shown.size() < text.size()) {
      const ssize_t n = ::read(master_, buffer.data(), buffer.size());
      if (n <= 0) break;
      shown.append(buffer.data(), static_cast<std::size_t>(n));
    }
    if (shown == text) return testing::AssertionSuccess();
    return testing::AssertionFailure() << testing::PrintToString(shown);
  }
  void Close() {
    if (master_ >= 0) ::close(master_);
    master_ = -1;
  }
  std::FILE* out() { return out_; }

 private:
  int master_ = -1;
  std::FILE* out_ = nullptr;
};

TEST(FormatCountTest, HasThreeDigitsAndTheUnitThatTheyRoundTo) {
  EXPECT_EQ(FormatCount(0.0), "0");
  EXPECT_EQ(FormatCount(678.0), "678");
  EXPECT_EQ(FormatCount(999.4), "999");
  EXPECT_EQ(FormatCount(999.6), "1k");
  EXPECT_EQ(FormatCount(34'512.0), "34.5k");
  EXPECT_EQ(FormatCount(999'600.0), "1M");
  EXPECT_EQ(FormatCount(12'500'000.0), "12.5M");
  EXPECT_EQ(FormatCount(3e9), "3G");
}

TEST(FormatBytesTest, GoesOnToGigabytes) {
  EXPECT_EQ(FormatBytes(0.0), "0 MB");
  EXPECT_EQ(FormatBytes(999.4e6), "999 MB");
  EXPECT_EQ(FormatBytes(999.6e6), "1.0 GB");
  EXPECT_EQ(FormatBytes(24.6e12), "24600.0 GB");
}

TEST(ProgressLineTest, ALogHasNoLineOfShortWork) {
  LogFile log;
  {
    ProgressLine line(log.file(), false);
    for (int s = 0; s < 10; ++s) line.Show("work", 1000.0 + s);
  }
  EXPECT_EQ(log.text(), "");
}

TEST(ProgressLineTest, ALogHasALineAMinuteAndTheLastState) {
  for (const int last : {190, 200}) {
    LogFile log;
    {
      ProgressLine line(log.file(), false);
      for (int s = 0; s <= last; ++s) line.Show(std::to_string(s), 1000.0 + s);
    }
    EXPECT_EQ(log.text(), last == 190 ? "10\n30\n70\n130\n190\n" : "10\n30\n70\n130\n190\n200\n");
  }
}

TEST(ProgressLineTest, TheLastTextStandsOnATerminalAtTheEnd) {
  Terminal terminal(80);
  ProgressLine line(terminal.out(), true);
  line.Show("0 of 500", 0.0);
  EXPECT_TRUE(terminal.Shows("\r\x1b[J0 of 500"));
  line.Show("500 of 500", 0.1);
  line.End();
  EXPECT_TRUE(terminal.Shows("\r\x1b[J500 of 500\n"));
  // Other output may stand below by now, and nothing of what was shown is to be rewritten.
  line.End();
  terminal.Resize(5);
  line.Show("again", 1.0);
  EXPECT_TRUE(terminal.Shows("\r\x1b[Jagai"));
}

TEST(ProgressLineTest, FollowsTheWidthOfTheTerminal) {
  Terminal terminal(31);
  ProgressLine line(terminal.out(), true);
  const std::string text = "abcdefghijklmnopqrstuvwxyz0123456789";
  line.Show(text, 0.0);
  EXPECT_TRUE(terminal.Shows("\r\x1b[J" + text.substr(0, 30)));
  // The 30 characters that stand there now take three rows of ten, and the cursor is in the third.
  terminal.Resize(10);
  line.Show(text, 1.0);
  EXPECT_TRUE(terminal.Shows("\r\x1b[2A\x1b[J" + text.substr(0, 9)));
  terminal.Resize(80);
  line.Show(text, 2.0);
  EXPECT_TRUE(terminal.Shows("\r\x1b[J" + text));
  line.Show("short", 3.0);
  EXPECT_TRUE(terminal.Shows("\r\x1b[Jshort"));
  terminal.Resize(10);
  line.Show("short", 4.0);
  EXPECT_TRUE(terminal.Shows("\r\x1b[Jshort")) << "only the first line was longer than a row";
  line.End();
}

TEST(ProgressLineTest, ATerminalThatWasClosedIsNoError) {
  Terminal terminal(80);
  ProgressLine line(terminal.out(), true);
  terminal.Close();
  line.Show("nobody reads this", 0.0);
  line.End();
}

}  // namespace
}  // namespace slalom::base
