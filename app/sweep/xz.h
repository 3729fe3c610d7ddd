#pragma once

#include <string>
#include <string_view>

namespace slalom::sweep {

/// The text in the format of `xz`, with a checksum. The same text gives the same bytes.
std::string CompressXz(std::string_view text);

/// The text that `CompressXz` was given. Throws `base::Error` that names `source` if the bytes are
/// not whole, or if the text is larger than 1 GiB.
std::string DecompressXz(std::string_view bytes, const std::string& source);

}  // namespace slalom::sweep
