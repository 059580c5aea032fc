/* Empty: Simulink's own registers the functions of the block. */
