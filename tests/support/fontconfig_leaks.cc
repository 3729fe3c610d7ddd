/// For tests that draw: fontconfig, below cairo, never frees what it has read. Asked for by
/// LeakSanitizer, unused elsewhere.
extern "C" const char* __lsan_default_suppressions();
extern "C" const char* __lsan_default_suppressions() { return "leak:libfontconfig\n"; }
