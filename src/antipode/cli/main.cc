#include "antipode/cli/program.h"

int main(int argc, char** argv) { return antipode::RunProgram({argv + 1, argv + argc}); }
