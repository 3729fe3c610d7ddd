// Payloads of samples and of priorities.

#include "replay/sample_bytes.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace slalom;
  fuzz::Input input(data, size);
  const bool weighted = input.TakeIn(0, 1) == 1;
  const bool fits = input.TakeIn(0, 7) != 0;
  const replay::SampleShape shape{fits ? input.TakeIn(1, 5) : 1 + (input.Take<int>() & 0x7ffffffe),
                                  fits ? input.TakeIn(1, 3) : 1 + (input.Take<int>() & 0x7ffffffe),
                                  fits ? input.TakeIn(1, 4) : 1 + (input.Take<int>() & 0x7ffffffe),
                                  weighted};
  fuzz::AlignedCopy raw(input.rest());
  const int count = static_cast<int>(input.rest().size() / 12);
  if (const auto priorities = replay::ParsePriorities(raw.bytes(), count)) {
    for (int i = 0; i < count; ++i) {
      fuzz::Require(priorities->sequence[i] >= 0 && priorities->priority[i] >= 0.0f);
    }
  }
  replay::SampledRows rows;
  (void)replay::ParseSample(raw.bytes(), shape, &rows);
  if (!fits) return 0;
  for (const std::size_t num_scans : {0, 1, 3}) {
    replay::ScanMirror mirror(5, shape.step.num_beams);
    fuzz::AlignedCopy sent(input.rest(), replay::MirroredSampleSize(shape, num_scans));
    if (replay::ParseMirroredSample(sent.bytes(), shape, num_scans, &mirror, &rows)) continue;
    mirror.Keep();
  }
  fuzz::AlignedCopy copy(input.rest(), replay::SampleSize(shape).value());
  if (replay::ParseSample(copy.bytes(), shape, &rows)) return 0;
  unsigned sum = 0;
  for (const auto* scans : {&rows.ranges_cm, &rows.next_ranges_cm}) {
    for (const std::uint16_t* scan : *scans) {
      for (int i = 0; i < shape.step.num_beams; ++i) sum += scan[i];
    }
  }
  // Written again it is the same bytes.
  fuzz::AlignedCopy again({}, copy.bytes().size());
  replay::WriteSample(rows, weighted, again.bytes());
  fuzz::Require(std::ranges::equal(again.bytes(), copy.bytes()));
  return static_cast<int>(sum & 0);
}
