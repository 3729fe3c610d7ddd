#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "base/file.h"

namespace slalom::test {

/// A script that lists in `clashes` the texts of one drawing whose boxes share more than a pixel
/// each way, and what runs out of the window.
inline constexpr char kFindClashes[] = R"(
      let clashes = '';
      for (const drawing of document.querySelectorAll('.plot svg')) {
        const boxes = [...drawing.querySelectorAll('text')].map((t) => [t, t.getBoundingClientRect()]);
        boxes.forEach(([t, a], i) => boxes.slice(i + 1).forEach(([u, b]) => {
          const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
          const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
          if (across > 1 && down > 4) clashes += `${t.textContent} / ${u.textContent}; `;
        }));
        for (const [t, a] of boxes) {
          if (a.left < -1 || a.right > innerWidth + 1) clashes += `${t.textContent} runs out; `;
        }
      }
      const root = document.documentElement;
      if (root.scrollWidth > root.clientWidth) clashes += `the page runs out (${root.scrollWidth}); `;
)";

/// How a page is opened.
struct Window {
  bool is_dark = false;
  std::string script = "";  ///< Run at the end of the page's own.
};

/// A headless Chromium that opens pages without a network.
class Browser {
 public:
  /// Keeps its files in `directory`. Requires: there is a browser (`Find`).
  explicit Browser(std::filesystem::path directory) : directory_(std::move(directory)) {}

  /// The browser's name; none: none is installed (Debian: apt-get install chromium).
  static std::optional<std::string> Find() {
    for (const char* name : {"chromium", "chromium-browser", "google-chrome"}) {
      if (std::system(fmt::format("command -v {} >/dev/null 2>&1", name).c_str()) == 0) return name;
    }
    return std::nullopt;
  }

  /// The page as it stands after its scripts ran for three seconds of the browser's own time.
  /// `hash`: of its address.
  std::string Render(std::string page, const std::string& hash = "",
                     const Window& window = {}) const {
    Write("page.html", std::move(page), window.script);
    return Open("file://" + (directory_ / "page.html").string() + hash, window);
  }

  /// The page at an address, of a file or of this machine, likewise. Of `window`, the script is not
  /// run.
  std::string Open(const std::string& address, const Window& window = {}) const {
    const std::string command = fmt::format(
        "HOME={0} {1} --headless --no-sandbox --disable-gpu --user-data-dir={0}/profile "
        "--host-resolver-rules='MAP * ~NOTFOUND, EXCLUDE 127.0.0.1' --window-size=1280,2000 {3} "
        "--virtual-time-budget=3000 --dump-dom '{2}' >{0}/dom.html 2>{0}/log",
        directory_.string(), Find().value(), address, window.is_dark ? "--force-dark-mode" : "");
    EXPECT_EQ(std::system(command.c_str()), 0) << base::ReadFile(directory_ / "log");
    return base::ReadFile(directory_ / "dom.html");
  }

  /// What `script` posts to the page around it, in which the page is a frame of this width: a
  /// window of its own is never as narrow as a phone.
  std::string PostedInFrame(std::string page, int width, const std::string& script) const {
    Write("framed.html", std::move(page), script);
    const std::string dom = Render(
        fmt::format("<!doctype html><body><iframe src=\"framed.html\" width=\"{}\" "
                    "height=\"844\" frameborder=\"0\"></iframe></body>",
                    width),
        "",
        {.script =
             "onmessage = (event) => { document.body.dataset.posted = `<${event.data}>`; };"});
    const std::string mark = "data-posted=\"&lt;";
    const std::size_t at = dom.find(mark);
    if (at == std::string::npos) return "nothing was posted";
    const std::size_t begin = at + mark.size();
    return dom.substr(begin, dom.find("&gt;\"", begin) - begin);
  }

 private:
  void Write(const std::string& file, std::string page, const std::string& script) const {
    page.insert(page.rfind("</body>"), "<script>" + script + "</script>");
    base::WriteFileAtomically(directory_ / file, page);
  }

  const std::filesystem::path directory_;
};

}  // namespace slalom::test
