const float attjax_torque_table[ATTJAX_ACTIONS][3] = $torque_table;
