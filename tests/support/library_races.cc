/// For tests with threads and sockets: libraries that are not instrumented and hand memory from
/// thread to thread by means that ThreadSanitizer does not see. ZeroMQ does, some of it by way of
/// the standard library, whose frames hide who called; spdlog's registry is made by the thread that
/// logs first. Asked for by ThreadSanitizer, unused elsewhere.
extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() {
  return "race:libzmq.so\nrace:libsodium.so\ncalled_from_lib:libstdc++.so\n"
         "race:spdlog::details::registry::registry\n";
}
