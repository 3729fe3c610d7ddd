/// For tests with sockets: ZeroMQ, which is not instrumented, hands memory from thread to thread by
/// means that ThreadSanitizer does not see, some of it by way of the standard library, whose frames
/// hide who called. Asked for by ThreadSanitizer, unused elsewhere.
extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() {
  return "race:libzmq.so\nrace:libsodium.so\ncalled_from_lib:libstdc++.so\n";
}
