# cmake -DBUILD=DIR -DCONSUMER=DIR -DWORK=DIR [-DLAUNCHER=ccache] -P run.cmake
# Installs the build tree BUILD to a fresh prefix, then configures, builds and runs the project CONSUMER against it.
# The consumer's own build folder is kept, so that a second run compiles only what changed.
set(prefix ${WORK}/prefix)
set(consumer_build ${WORK}/build)

function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${prefix})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${CONSUMER} -B ${consumer_build} -G Ninja -DCMAKE_BUILD_TYPE=Release
  -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER})
run(${CMAKE_COMMAND} --build ${consumer_build})
run(${consumer_build}/geometry_consumer)
run(${CMAKE_COMMAND} -E env ANTIPODE_MODELS=${prefix}/share/antipode/models ${consumer_build}/umbrella_consumer)
if(EXISTS ${consumer_build}/prior_consumer)
  run(${consumer_build}/prior_consumer)
endif()
if(EXISTS ${prefix}/bin/antipode)
  run(${prefix}/bin/antipode --version)
endif()
