# slalom_import_libtorch(FOLDER): the target `torch` of a LibTorch that lies in one folder, as it is downloaded or as pip
# installs it (site-packages/torch), with CUDA or without. Its own TorchConfig.cmake asks for a CUDA toolkit wherever it has
# CUDA. Nothing here is compiled for a GPU, so the folder is enough.
function(slalom_import_libtorch FOLDER)
  find_path(SLALOM_LIBTORCH_INCLUDE torch/csrc/autograd/custom_function.h PATHS ${FOLDER}/include NO_DEFAULT_PATH)
  if(NOT SLALOM_LIBTORCH_INCLUDE)
    message(FATAL_ERROR "SLALOM_LIBTORCH is '${FOLDER}', expected the folder of a LibTorch with include/torch/ and lib/")
  endif()
  # Whatever refers to it or not, as LibTorch finds CUDA by what is loaded.
  set(libraries "-Wl,--push-state,--no-as-needed")
  foreach(name torch torch_cpu c10 torch_cuda c10_cuda)
    find_library(SLALOM_LIBTORCH_${name} ${name} NO_DEFAULT_PATH
      PATHS ${FOLDER}/lib ${FOLDER}/lib/${CMAKE_LIBRARY_ARCHITECTURE})
    if(SLALOM_LIBTORCH_${name})
      list(APPEND libraries ${SLALOM_LIBTORCH_${name}})
    elseif(NOT name MATCHES "cuda")
      message(FATAL_ERROR "SLALOM_LIBTORCH is '${FOLDER}', which has no lib${name}.so in lib/")
    endif()
  endforeach()
  list(APPEND libraries "-Wl,--pop-state")
  file(STRINGS ${SLALOM_LIBTORCH_c10} new_abi REGEX "__cxx11" LIMIT_COUNT 1)
  if(NOT new_abi)
    message(FATAL_ERROR "SLALOM_LIBTORCH is '${FOLDER}', which is built for the old ABI of C++ (_GLIBCXX_USE_CXX11_ABI=0); "
      "expected the new one, as Debian's packages have it: the download called 'cxx11 ABI', or version 2.7 and later")
  endif()
  if(SLALOM_LIBTORCH_torch_cuda)
    message(STATUS "LibTorch with CUDA: ${FOLDER}")
  else()
    message(STATUS "LibTorch without CUDA: ${FOLDER}")
  endif()
  # Only its own headers: a download of pip has those of fmt and others beside them, which would hide Debian's.
  set(include ${CMAKE_BINARY_DIR}/libtorch-include)
  file(MAKE_DIRECTORY ${include})
  foreach(folder ATen c10 caffe2 torch)
    if(EXISTS ${SLALOM_LIBTORCH_INCLUDE}/${folder})
      file(CREATE_LINK ${SLALOM_LIBTORCH_INCLUDE}/${folder} ${include}/${folder} SYMBOLIC)
    endif()
  endforeach()
  add_library(torch INTERFACE IMPORTED GLOBAL)
  target_include_directories(torch SYSTEM INTERFACE ${include} ${include}/torch/csrc/api/include)
  # What its libraries need in turn (CUDA's own, the driver) is found when a program starts.
  target_link_libraries(torch INTERFACE ${libraries} -Wl,--allow-shlib-undefined)
endfunction()
